// The page: what is drawn where, and who listens to whom.

import { Diagram } from "./diagram.js";
import { copyLink, copyPython, showCommands, showHelp } from "./dialogs.js";
import { showFacts } from "./facts.js";
import { Heatmap } from "./heatmap.js";
import { keysFor, listen } from "./keys.js";
import { session } from "./session.js";
import { Spectrum } from "./spectrum.js";
import { Stage } from "./stage.js";
import { Timeline } from "./timeline.js";
import { view } from "./view.js";
import { damageWords, plain } from "./words.js";

const element = (id) => document.getElementById(id);
const places = ["diagram", "diagram-tools", "legend"].map(element);
const diagram = new Diagram(...places);
const heatmap = new Heatmap(...places);
heatmap.svg.style.display = "none";
const stage = new Stage();
const timeline = new Timeline(element("timeline"));
new Spectrum(element("spectrum"));

const isDark = () => (view.get("theme") || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";

function showTheme() {
  document.documentElement.dataset.theme = isDark() ? "dark" : "light";
  stage.setTheme(isDark());
}

function changeTheme() {
  view.set({ theme: isDark() ? "light" : "dark" });
}

session.on("stores", () => {
  element("store").replaceChildren(...session.stores.map(({ name, noun, error }, i) => new Option(`${name} · ${error ? "not readable" : noun}`, i)));
  element("store").value = view.get("store");
});
session.on("overview", () => {
  const { overview } = session;
  const isMap = overview.map !== undefined;
  diagram.svg.style.display = isMap ? "none" : "";
  heatmap.svg.style.display = isMap ? "" : "none";
  (isMap ? heatmap : diagram).arrange();
  element("about").textContent = plain(overview.words);
  document.title = `${overview.name} · shapespace`;
});
session.on("closed", () => {
  for (const id of ["diagram-tools", "legend"]) element(id).replaceChildren();
  for (const chart of [diagram, heatmap]) chart.svg.replaceChildren();
  element("about").textContent = "";
  showFacts(element("facts"));
});
session.on("state", () => {
  showFacts(element("facts"));
  for (const id of ["continue", "python"]) element(id).disabled = !session.state.python;
});
session.on("trouble", () => {
  const told = [session.trouble, ...damageWords([...session.damage])].filter(Boolean);
  element("trouble").textContent = told.join("\n");
  element("trouble").hidden = !told.length;
});

element("store").addEventListener("change", () => view.changeStore(element("store").value));
view.on(["store"], () => { element("store").value = view.get("store"); });
view.on(["theme"], showTheme);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", showTheme);

const keys = keysFor({ timeline, stage, changeTheme });
listen(keys);
element("continue").addEventListener("click", showCommands);
element("python").addEventListener("click", copyPython);
element("link").addEventListener("click", copyLink);
element("theme").addEventListener("click", changeTheme);
element("help").addEventListener("click", () => showHelp(keys));

showTheme();
// Numbers and lines are there while the library that draws the surface still loads, and so is a map with its colours.
const first = new Promise((done) => {
  session.on("overview", () => session.overview.map || done());
  session.on("painted", done);
  session.on("trouble", () => session.trouble && done());
});
const opening = session.open();
await first;
await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
await stage.start(isDark);
await opening;
