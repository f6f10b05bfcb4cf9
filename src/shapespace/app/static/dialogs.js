// Going on from a state: commands, Python, a link; and the keys.

import { isFile } from "./data.js";
import { session } from "./session.js";
import { escaped, number } from "./words.js";

const dialog = document.getElementById("dialog");
const toast = document.getElementById("toast");
let closing = 0;

export function say(words) {
  toast.textContent = words;
  toast.hidden = false;
  clearTimeout(closing);
  closing = setTimeout(() => { toast.hidden = true; }, 2600);
}

/** Put text on the clipboard; where the browser forbids it, show it to be copied by hand. */
export async function copy(text, words) {
  try {
    await navigator.clipboard.writeText(text);
    say(words);
  } catch {
    open(words, `<p>This browser does not let a page copy; take it from here.</p><pre>${escaped(text)}</pre>`);
  }
}

export function copyPython() {
  if (session.state?.python) copy(session.state.python, "Python copied");
}

export function copyLink() {
  copy(location.href, isFile ? "Address copied" : "Address copied; it works while this program runs");
}

export function showCommands() {
  if (!session.state?.commands) return;
  open(`Continue from ${session.state.title}`, "<p>Commands for a terminal. Each begins at this very state and writes to a new folder.</p>");
  dialog.append(...session.state.commands.map(entry));
}

const MEANINGS = {
  steady: "the state at rest there, with its growth rates", run: "let it move from there",
  branch: "follow the state while a key changes", curve: "follow this point in a second key",
};

/** A command with its choices, written anew as they change. */
function entry(command) {
  const part = document.createElement("section");
  const isOpen = command.keys !== undefined;
  part.innerHTML = `<h3>${command.name}: ${MEANINGS[command.name]}</h3>
    ${isOpen ? `<div class="row"><label>vary <select></select></label> <label>to <input type="number" step="any"></label></div>` : ""}
    <pre id="command-${command.name}"></pre><div class="row"><button>Copy</button></div>`;
  const text = () => {
    if (!isOpen) return command.text;
    return command.text.replace("{vary}", part.querySelector("select").value).replace("{stop}", part.querySelector("input").value);
  };
  const write = () => { part.querySelector("pre").replaceChildren(...wrapped(text())); };
  if (isOpen) {
    const select = part.querySelector("select");
    for (const key of command.keys) select.add(new Option(key, key, false, key === command.vary));
    part.querySelector("input").value = command.stop;
    part.addEventListener("input", write);
  }
  part.querySelector("button").addEventListener("click", () => copy(text(), `${command.name} copied`));
  write();
  return part;
}

/** A command whose lines break between words, not within an option. */
function wrapped(text) {
  return text.split(/(\s+)/).map((word) => {
    if (!word.startsWith("-")) return word;
    const option = document.createElement("span");
    option.className = "option";
    option.textContent = word;
    return option;
  });
}

export function showHelp(keys) {
  const rows = keys.map(({ shown, words }) => `<tr><td>${shown.map((key) => `<kbd>${key}</kbd>`).join(" ")}</td><td>${words}</td></tr>`);
  const { overview } = session;
  const about = overview ? `<p>${escaped(overview.path)}<br>${escaped(overview.scenario)}, ${escaped(overview.noun)}, made ${escaped(overview.created)} by shapespace ${escaped(overview.version)}: ${escaped(overview.outcome ?? "unfinished")}. ${escaped(overview.advice)}</p>` : "";
  const values = overview ? Object.entries(overview.parameters).map(([key, value]) => `${escaped(key)} = ${number(value)}`).join(", ") : "";
  open("Help", `<h3>This store</h3>${about}<p>${values}</p>
    <h3>The surface</h3><p>Drag it to turn it, scroll or pinch to come nearer, double-click to go back; or, when the keyboard is at it,
    <kbd>←</kbd> <kbd>→</kbd> <kbd>↑</kbd> <kbd>↓</kbd> turn it, <kbd>+</kbd> and <kbd>−</kbd> change the distance and <kbd>Home</kbd> goes back.
    Click a growth rate to see its mode.</p><h3>Keys elsewhere</h3><table>${rows.join("")}</table>`);
}

/** The head stays in sight, with the first button there is, so that the keyboard begins at the top. */
function open(title, content) {
  dialog.innerHTML = `<form method="dialog" class="head"><h2 id="dialog-title">${escaped(title)}</h2><button>Close</button></form>${content}`;
  if (!dialog.open) dialog.showModal();
  dialog.scrollTop = 0;
}
