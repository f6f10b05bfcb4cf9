// Questions to the program that serves this page, or to the answers in this file where it was exported.

const KEPT = 400;
const remembered = new Map();
let answers = null;

export const isFile = document.getElementById("answers") !== null;

/** The answer to a question; an Error with the program's own words where there is none. */
export async function ask(name, asked = {}) {
  const words = new URLSearchParams(asked).toString();
  const question = words ? `${name}?${words}` : name;
  if (isFile) {
    answers ??= await unpacked(document.getElementById("answers").textContent);
    if (!(question in answers)) throw new Error("This is not in the file; open the store with `shapespace explore`.");
    return decoded(structuredClone(answers[question]));
  }
  let response;
  try {
    response = await fetch(`api/${question}`);
  } catch {
    throw new Error("The program that serves this page has ended; start `shapespace explore` again.");
  }
  const isAnswer = response.headers.get("Content-Type")?.startsWith("application/json");
  const answer = isAnswer ? await response.json() : { error: await response.text() };
  if (answer.error !== undefined) throw new Error(answer.error);
  return decoded(answer);
}

/** As `ask`, each question once; for states, which do not change. */
export function recall(name, asked) {
  const key = name + JSON.stringify(asked);
  if (!remembered.has(key)) {
    const answer = ask(name, asked);
    answer.catch(() => remembered.delete(key));
    remembered.set(key, answer);
    if (remembered.size > KEPT) remembered.delete(remembered.keys().next().value);
  }
  return remembered.get(key);
}

export function forget() {
  remembered.clear();
}

async function unpacked(text) {
  const bytes = bytesOf(text.trim());
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(stream).text());
}

function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

const KINDS = { f8: Float64Array, f4: Float32Array, i1: Int8Array };

/** Arrays in place of their base64, wherever they stand. */
function decoded(value) {
  if (Array.isArray(value)) return value.map(decoded);
  if (value === null || typeof value !== "object") return value;
  const names = Object.keys(value);
  if (names.length === 1 && names[0] in KINDS) return new KINDS[names[0]](bytesOf(value[names[0]]).buffer);
  for (const name of names) value[name] = decoded(value[name]);
  return value;
}
