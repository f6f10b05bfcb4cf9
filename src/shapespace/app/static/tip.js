// The words beside the pointer.

const tip = document.getElementById("tip");

export function showTip(event, content) {
  tip.innerHTML = content;
  tip.hidden = false;
  const { offsetWidth: width, offsetHeight: height } = tip;
  const left = event.clientX + 14 + width > innerWidth ? event.clientX - width - 10 : event.clientX + 14;
  tip.style.left = `${Math.max(4, left)}px`;
  tip.style.top = `${Math.max(4, Math.min(event.clientY - height - 8, innerHeight - height - 4))}px`;
}

export function hideTip() {
  tip.hidden = true;
}
