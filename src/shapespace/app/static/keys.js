// Everything by keyboard.

import { isFile } from "./data.js";
import { copyLink, copyPython, showCommands, showHelp } from "./dialogs.js";
import { placeOf, session } from "./session.js";
import { view } from "./view.js";

/** Keys with what they do. */
export function keysFor({ timeline, stage, changeTheme }) {
  const keys = [
    { keys: ["ArrowRight"], shown: ["→"], words: "next state; on a map, one to the right", act: () => step(1, 0) },
    { keys: ["ArrowLeft"], shown: ["←"], words: "state before; on a map, one to the left", act: () => step(-1, 0) },
    { keys: ["ArrowUp"], shown: ["↑"], words: "on a map, one up", act: () => step(0, 1), isMap: true },
    { keys: ["ArrowDown"], shown: ["↓"], words: "on a map, one down", act: () => step(0, -1), isMap: true },
    { keys: ["Home"], shown: ["Home"], words: "first state; on a map, first of its row", act: () => ends(0) },
    { keys: ["End"], shown: ["End"], words: "last state; on a map, last of its row", act: () => ends(-1) },
    { keys: ["n", "]"], shown: ["n"], words: "next labelled point", act: () => labelled(1) },
    { keys: ["b", "["], shown: ["b"], words: "labelled point before", act: () => labelled(-1) },
    { keys: [" "], shown: ["space"], words: "play or pause a run; stop or start a mode", act: () => (timeline.isRun ? timeline.toggle() : swing(0)) },
    { keys: ["1", "2", "3", "4", "5", "6"], shown: ["1", "…", "6"], words: "swing along a mode", act: (key) => swing(Number(key) - 1) },
    { keys: ["Escape"], shown: ["Esc"], words: "stop swinging", act: () => session.mode && session.stopMode() },
    { keys: ["k"], shown: ["k"], words: "next field as colour", act: () => next(stage) },
    { keys: ["f"], shown: ["f"], words: "flow arrows on or off", act: () => view.set({ arrows: view.get("arrows") === "1" ? "0" : "1" }) },
    { keys: ["c"], shown: ["c"], words: "commands that go on from here", act: showCommands },
    { keys: ["p"], shown: ["p"], words: "copy as Python", act: copyPython },
    { keys: ["l"], shown: ["l"], words: "copy the link", act: copyLink },
    { keys: ["s"], shown: ["s"], words: "next store", act: nextStore },
    { keys: ["t"], shown: ["t"], words: "light or dark", act: changeTheme },
  ];
  return [...keys, { keys: ["?"], shown: ["?"], words: "this help", act: () => showHelp(keys) }];
}

export function listen(keys) {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("dialog").open) return;
    if (event.target.matches("select, input:not([type=checkbox]), textarea")) return;
    if (event.key === " " && event.target.matches("button, input")) return;
    const found = keys.find((one) => one.keys.includes(event.key) && (!one.isMap || session.overview?.map));
    if (!found || !session.overview) return;
    event.preventDefault();
    found.act(event.key);
  });
}

function step(across, up) {
  const { map } = session.overview;
  const { places } = session;
  if (!session.state) return;
  if (map) {
    const [state, i, j] = session.state.place.split(",").map(Number);
    const held = (value, count) => Math.max(0, Math.min(count - 1, value));
    const [far, high] = isFile ? map.strides : [1, 1];
    session.choose(placeOf(map, state, held(i + far * across, map.x.values.length), held(j + high * up, map.y.values.length)));
  } else {
    const i = places.indexOf(session.state.place) + across;
    if (i >= 0 && i < places.length) session.choose(places[i]);
  }
}

function ends(at) {
  const { map } = session.overview;
  const [state, , j] = map && session.state ? session.state.place.split(",").map(Number) : [];
  const place = map ? placeOf(map, state, at && map.x.values.length - 1, j) : session.places.at(at);
  if (place !== undefined) session.choose(place);
}

function labelled(way) {
  const { places, labels } = session.overview.table ?? {};
  if (!labels) return;
  let i = places.indexOf(session.state?.place) + way;
  while (i >= 0 && i < places.length && !labels[i]) i += way;
  if (places[i] !== undefined && labels[i]) session.choose(places[i]);
}

function swing(index) {
  if (session.mode?.index === index || (session.mode && index === 0)) session.stopMode();
  else if (index < (session.state?.rates?.values.length ?? 0)) session.animate(index);
}

function next(stage) {
  const { names, colour } = stage;
  if (names.length) view.set({ colour: names[(names.indexOf(colour) + 1) % names.length] });
}

function nextStore() {
  if (session.stores.length > 1) view.changeStore((Number(view.get("store")) + 1) % session.stores.length);
}
