// Labelled lists to choose from.

import { plain } from "./words.js";

/** Put other lists in place of those in an element; the one that the keyboard is at stays so. */
export function refill(host, ...parts) {
  const { id } = host.contains(document.activeElement) ? document.activeElement : {};
  host.replaceChildren(...parts);
  if (id) document.getElementById(id)?.focus();
}

/** A list whose choice is told to `chosen`. options: names, or [value, words]. */
export function choice(words, options, value, chosen, { swatch, id } = {}) {
  const label = document.createElement("label");
  const select = document.createElement("select");
  if (id) select.id = id;
  select.setAttribute("aria-label", words);
  for (const option of options) {
    const [key, shown] = Array.isArray(option) ? option : [option, plain(option)];
    select.add(new Option(shown, key, false, key === value));
  }
  select.value = value;
  select.addEventListener("change", () => chosen(select.value));
  if (swatch) {
    const mark = document.createElement("span");
    mark.className = "swatch";
    mark.style.background = swatch;
    label.append(mark);
  } else {
    label.append(words);
  }
  label.append(select);
  return label;
}

export function toggle(words, isOn, chosen, id) {
  const label = document.createElement("label");
  const box = document.createElement("input");
  box.type = "checkbox";
  box.checked = isOn;
  if (id) box.id = id;
  box.addEventListener("change", () => chosen(box.checked));
  label.append(box, words);
  return label;
}
