// The way to the rig's program: one socket that tells, and requests that ask. Everything the page does goes through here.
import { kept, notice } from "./ui.js";

/**
 * The last state received, and this client.
 * @type {{ state: import("./state").State | null, client: import("./state").Hello | null, connected: boolean }}
 */
export const store = { state: null, client: null, connected: false };

/** @type {Map<string, Set<(...values: any[]) => void>>} */
const listeners = new Map();
/** @type {WebSocket | null} */
let socket = null;
let wait = 250;
/** The run of the server that this page is of. */
let server = "";
/** Where the secret of this page survives a reload. */
const SECRET = "farnear-client";
/** The secret is stored only while the page is loaded again: a duplicated tab gets a copy of the storage, and would take control. */
let secret = kept("sessionStorage", SECRET);
kept("sessionStorage", SECRET, null);
addEventListener("pagehide", () => secret && kept("sessionStorage", SECRET, secret));
addEventListener("pageshow", () => kept("sessionStorage", SECRET, null));
/** Seconds without a message after which the connection is lost. The server sends one every two seconds. */
const QUIET = 8;
let quiet = 0;
/** Longest wait for the answer to a stop, ms. The server answers within a second. */
const STOPPED = 3000;

/** Listens to `state`, `image`, `depth` or `link`; gives what ends it. */
export function on(event, listener) {
  const those = listeners.get(event) ?? new Set();
  listeners.set(event, those.add(listener));
  return () => those.delete(listener);
}

function emit(event, ...values) {
  for (const listener of listeners.get(event) ?? []) listener(...values);
}

/** Whether this browser has control. */
export function hasControl() {
  return store.connected && store.state?.control.holder === store.client?.client;
}

/** Opens the socket, and opens it again whenever it breaks. */
export function open() {
  // After a reload the page keeps control: it shows that it is the same page.
  const opened = new WebSocket(`ws://${location.host}/api/socket${secret ? `?resume=${secret}` : ""}`);
  [socket, quiet] = [opened, 0];
  opened.binaryType = "arraybuffer";
  opened.onmessage = ({ data }) => {
    if (socket !== opened) return;
    quiet = 0;
    if (typeof data === "string") told(JSON.parse(data));
    else pictured(data);
  };
  opened.onclose = () => lost(opened);
}

/** Opens another socket. The browser may report the end of one whose server has vanished minutes later, or never. */
function lost(ended) {
  if (socket !== ended) return;
  socket = null;
  store.connected = false;
  store.client = null;
  emit("link");
  setTimeout(open, wait);
  wait = Math.min(2 * wait, 4000);
}

// Ticks are counted, not time: a page that was busy or asleep has missed both messages and ticks.
setInterval(() => {
  const silent = socket;
  if (!silent || ++quiet <= QUIET) return;
  lost(silent);
  silent.close();
}, 1000);

function told(message) {
  if (message.type === "hello") {
    // A restarted server has other jobs, and perhaps another page.
    if (server && server !== message.hello.server) return location.reload();
    server = message.hello.server;
    store.client = message.hello;
    secret = message.hello.secret;
    store.connected = true;
    wait = 250;
    emit("link");
  } else if (message.type === "state") {
    const before = store.state;
    store.state = message.state;
    emit("state", store.state, before);
  } else if (message.type === "error") notice(message.error, "error");
}

function pictured(data) {
  if (data.byteLength < 4) return;
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  emit(header.type, header, new Uint8Array(data, 4 + length));
  if (socket?.readyState === WebSocket.OPEN) socket.send('{"type":"seen"}');
}

/** Asks for something; throws what went wrong, with `hint`. */
export async function call(method, path, body) {
  const headers = { "x-farnear-client": store.client?.secret ?? "" };
  if (body !== undefined) headers["content-type"] = "application/json";
  let answer;
  try {
    answer = await fetch(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body) });
  } catch {
    throw new Error("farnear does not answer; does it still run?");
  }
  if (!answer.ok) throw await failure(answer);
  return answer.json().catch(() => ({}));
}

/** The error of an answer, with `hint` and `status`. @param {Response} answer */
export async function failure(answer) {
  const given = await answer.json().catch(() => ({}));
  return Object.assign(new Error(given.error ?? `failed (${answer.status})`), { hint: given.hint, status: answer.status });
}

export const get = (path) => call("GET", path);
export const put = (path, body) => call("PUT", path, body);

/** Does something and reports what went wrong; gives the answer, or null. `body` may be a function that returns the body: its errors are reported too.
 * @param {string} path @param {any} body */
export async function act(path, body = {}, method = "POST") {
  try {
    return await call(method, path, typeof body === "function" ? await body() : body);
  } catch (error) {
    notice(error.message, "error", error.hint);
    return null;
  }
}

/** Stops the rig. The socket is the shortest way, but a dead connection loses the message. A request that fails or is late is reported. */
export function stop() {
  if (socket?.readyState === WebSocket.OPEN) socket.send('{"type":"stop"}');
  const late = setTimeout(() => notice("farnear has not answered the stop.", "error", "Use the emergency stop of the rig if something moves."), STOPPED);
  act("/api/stop").finally(() => clearTimeout(late));
}

/** Bytes of a file. @param {string} path */
export async function bytes(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw await failure(answer);
  return answer.arrayBuffer();
}

/** Tells each job of a kind, whichever page began it, once when it runs and once when it has ended; `old`: it had ended before this page
 * was opened. What a job found is shown by this alone, so it is also there after a reload.
 * @param {string} kind @param {(job: import("./state").Job, old: boolean) => void} tell */
export function onJob(kind, tell) {
  const told = { job: "", computation: "" };
  on("state", (state, before) => {
    for (const queue of ["job", "computation"]) {
      const job = state[queue];
      const now = `${job?.id} ${job?.phase}`;
      if (told[queue] === now) continue;
      told[queue] = now;
      if (job?.kind === kind) tell(job, !before && job.phase !== "running");
    }
  });
}

/** Waits for the end of a job. `queue` is `job` (on the rig) or `computation`. */
export function ended(queue, id) {
  return new Promise((done) => {
    const look = (state) => {
      const job = state?.[queue];
      if (job && (job.id > id || (job.id === id && job.phase !== "running"))) {
        off();
        done(job);
      }
    };
    const off = on("state", look);
    look(store.state);
  });
}
