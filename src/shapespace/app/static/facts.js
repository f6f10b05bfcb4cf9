// The numbers of a state.

import { session } from "./session.js";
import { escaped, html, number, safe, stabilityWords } from "./words.js";

export function showFacts(host) {
  const { state } = session;
  if (!state) {
    host.replaceChildren();
    return;
  }
  const { observables, parameters = {}, missing } = state;
  const told = Object.entries(parameters).map(([name, value]) => `<span>${safe(name)} <b data-name="${escaped(name)}" data-value="${Number(value)}" style="font-size:13px">${number(value, 7)}</b></span>`);
  const time = state.time === undefined || state.time === null ? "" : `<span>time <b data-name="time" data-value="${Number(state.time)}" style="font-size:13px">${number(state.time)}</b> ${unitOf("time")}</span>`;
  const head = `<p class="title"><b>${escaped(state.title)}</b>${badge(state)}${time}${told.join("")}</p>`;
  const none = missing ? `<p>${escaped(missing[0].replaceAll("-", " "))}. ${escaped(missing[1])}</p>` : "";
  const rows = Object.entries(observables).filter(([name]) => name !== "time").map(([name, value]) => {
    const { symbol, meaning } = session.quantity(name);
    return `<div title="${escaped(meaning)}"><dt><span>${safe(name)}</span> <i>${html(symbol)}</i></dt>`
      + `<dd data-name="${escaped(name)}" data-value="${Number(value)}">${number(value)} <small>${unitOf(name)}</small></dd></div>`;
  });
  host.innerHTML = `${head}${none}<dl>${rows.join("")}</dl>`;
}

function unitOf(name) {
  const { unit } = session.quantity(name);
  return unit === "1" ? "" : html(unit);
}

function badge({ missing, unstable, rates }) {
  if (missing || unstable === undefined || unstable === null) return "";
  const words = stabilityWords(unstable, rates?.marginal);
  return `<span class="badge ${unstable ? "growing" : rates?.marginal ? "unknown" : ""}">${words}</span>`;
}
