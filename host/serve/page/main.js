// The page: views, connection to the rig, control, alarms, running jobs.
import { act, hasControl, on, open, stop, store } from "./link.js";
import { h, ask, button, dropErrors, ignoreMarked, keep, kept, notice, refocus, say, write } from "./ui.js";
import { help, key, listen } from "./keys.js";
import * as rig from "./rig.js";
import * as live from "./live.js";
import * as depth from "./depth.js";
import * as lens from "./lens.js";
import * as sessions from "./sessions.js";
import * as quality from "./quality.js";
import * as guides from "./guides.js";
import * as log from "./log.js";
import { whenCaptured } from "./capture.js";

/** @param {string} id */
const $ = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
const views = new Map();
let current = null;

function theme(next) {
  const wanted = next ?? kept("localStorage", "farnear-theme") ?? "";
  if (wanted) document.documentElement.dataset.theme = wanted;
  else delete document.documentElement.dataset.theme;
}

function turnTheme() {
  const dark = document.documentElement.dataset.theme ? document.documentElement.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  const next = dark ? "light" : "dark";
  kept("localStorage", "farnear-theme", next);
  theme(next);
  dispatchEvent(new Event("restyle"));
}

function addView(name, title, make) {
  const host = h("section", { class: "view", id: `view-${name}`, role: "tabpanel", "aria-labelledby": `tab-${name}`, hidden: true });
  const tab = h("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `view-${name}`, "aria-selected": "false", onclick: () => go(name) }, title);
  $("view").append(host);
  $("tabs").append(tab);
  views.set(name, { host, tab, parts: make(host) });
  const number = views.size;
  key(String(number), title, () => go(name));
}

/** Shows a view; the address remembers it, with the capture that is open. */
function go(name, detail, back = false) {
  const view = views.get(name) ?? views.get("live");
  const within = $("view").contains(document.activeElement);
  for (const [other, { host, tab }] of views) {
    host.hidden = views.get(other) !== view;
    tab.setAttribute("aria-selected", !host.hidden);
    tab.tabIndex = host.hidden ? -1 : 0;
    if (!host.hidden) current = other;
  }
  if (within && document.activeElement?.closest("[hidden]")) refocus();
  document.title = `${view.tab.textContent} – farnear`;
  // A small screen does not show all tabs.
  const { tab } = view;
  if (tab.parentElement.scrollWidth > tab.parentElement.clientWidth) tab.parentElement.scrollLeft = tab.offsetLeft - tab.parentElement.offsetLeft - 40;
  const address = `#${current}${detail ? `/${encodeURIComponent(detail)}` : ""}`;
  if (!back && location.hash && location.hash !== address) history.pushState(null, "", address);
  else history.replaceState(null, "", address);
  view.parts?.shown?.(detail);
}

/** A part of the address; nothing where it is not encoded as one. @param {string} text */
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return undefined;
  }
}

function tabKeys(event) {
  const names = [...views.keys()];
  const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (!step) return;
  event.preventDefault();
  go(names[(names.indexOf(current) + step + names.length) % names.length]);
  views.get(current).tab.focus();
}

function showLink() {
  const link = $("link");
  const phase = !store.connected ? "lost" : store.state?.rig.phase ?? "connecting";
  link.dataset.phase = phase;
  const words = { ready: "connected", connecting: "connecting", lost: store.connected ? "rig lost" : "no connection", absent: "no rig" };
  write(link, words[phase]);
}

function showControl(state) {
  const who = $("who");
  const { holder, requested_by: asking, clients: count } = state.control;
  const watchers = count > 1 ? ` · ${count} browsers` : "";
  const [known, mine, waits] = [store.client?.client, hasControl(), asking != null && asking === store.client?.client];
  keep(who, [known, mine, waits, holder, count], () => {
    if (mine) return [`you have control${watchers}`];
    if (!known) return [""];
    return [h("span", {}, holder ? "another browser has control" : "no browser has control"),
      button(waits ? "asked …" : "Ask for control", () => act("/api/control/request"), { disabled: waits, class: "quiet" })];
  });
}

/** A question that is open while its key stays the same; null closes it. An answer to a closed question is dropped. */
function asking() {
  let present = null;
  let closing = new AbortController();
  return async (key, question, options, answered) => {
    if (key === present) return;
    present = key;
    closing.abort();
    if (key === null) return;
    closing = new AbortController();
    const { signal } = closing;
    const answer = await ask(question, { ...options, signal });
    if (!signal.aborted) answered(answer);
  };
}
const [askForControl, askForJob] = [asking(), asking()];

/** Questions to the browser that has control. */
function showQuestions({ control: { requested_by: to }, question, questions: number }) {
  const mine = hasControl();
  askForControl(mine ? to : null, "Another browser asks for control.", { yes: "Hand over", no: "Keep" },
    (answer) => act("/api/control/answer", { to, give: answer !== null }));
  askForJob(mine && question !== null ? number : null, question, { text: true, yes: "Answer", no: "Give up" }, (answer) => {
    if (answer !== null) act("/api/answer", { text: answer });
    else if (store.state?.question != null && store.state.questions === number) stop();
  });
}

function showAlarm({ rig: { info } }) {
  const alarm = $("alarm");
  const words = info?.alarm ? [h("strong", {}, `Alarm ${info.alarm}`), h("span", {}, info.alarm_text), button("Clear", () => act("/api/rig/alarms/clear", { number: info.alarm }), { disabled: !hasControl() })]
    : info?.emergency_stop ? [h("strong", {}, "Emergency stop is pressed"), h("span", {}, "Release it to go on.")] : null;
  const text = `${words?.map((part) => part.textContent).join(" ") ?? ""} ${hasControl()}`;
  if (alarm.dataset.text === text) return;
  alarm.dataset.text = text;
  alarm.hidden = !words;
  alarm.replaceChildren(...(words ?? []));
}

function showJob(state, before) {
  const place = $("job");
  const running = [state.job, state.computation].filter((job) => job?.phase === "running");
  place.hidden = !running.length;
  const line = (job) => {
    const cancel = job === state.computation ? button("Cancel", () => act("/api/cancel")) : button("Stop", stop, { class: "stop small" });
    return h("div", { class: "job-line" }, h("strong", {}, job.title), h("span", { class: "said" }), h("progress", { max: 1, "aria-label": job.title }), cancel);
  };
  keep(place, running.map((job) => [job.id, job.kind]), () => running.map(line));
  running.forEach((job, at) => {
    const [, said, progress] = place.children[at].children;
    const bar = /** @type {HTMLProgressElement} */ (progress);
    const { total, done, unit } = job.progress ?? {};
    // An indeterminate bar is animated all the time, which costs more than the counting; a count shows progress.
    bar.hidden = done != null && !total;
    said.textContent = bar.hidden ? `${done} ${unit}` : job.said ?? "";
    if (total) bar.value = done / total;
    else bar.removeAttribute("value");
  });
  for (const queue of ["job", "computation"]) {
    const job = state[queue];
    if (before && job?.phase === "running" && before[queue]?.id !== job.id) say(`${job.title} has begun`);
    ended(job, before?.[queue], !before);
  }
}

/** Warnings of the last job stay until they are closed or the next job ends. */
function showWarnings({ title, warnings }) {
  const place = $("warnings");
  place.hidden = false;
  place.replaceChildren(h("strong", {}, title), h("ul", {}, warnings.map((text) => h("li", {}, text))), button("×", () => { place.hidden = true; }, { class: "quiet", "aria-label": "Close warnings" }));
}

/** The last job of each kind whose end was reported. @type {Map<string, number>} */
const seen = new Map();

function ended(job, before, fresh) {
  if (!job || job.phase === "running") return;
  // A job that ends at once was never seen running: its number is new.
  const known = before?.id === job.id && before.phase !== "running";
  if (known || seen.get(job.kind) === job.id) return;
  seen.set(job.kind, job.id);
  if (fresh) return; // ended before this page was opened
  dropErrors(job.kind);
  if (job.phase === "done") say(`${job.title}: done`);
  if (job.phase === "failed") notice(`${job.title}: ${job.error}`, "error", job.hint, job.kind);
  else if (job.phase === "stopped") notice(`${job.title}: stopped${/cancel|stopp/i.test(job.error ?? "") ? "" : ` (${job.error})`}`);
  else if (job.warnings.length) showWarnings(job);
}

/** A fault of the page itself is reported: silence would look like a dead button. */
function reportFaults() {
  // Delayed size notifications are not errors.
  addEventListener("error", ({ message }) => !message.startsWith("ResizeObserver") && notice(`Fault of the page: ${message}`, "error", "Reload the page; please report it."));
  addEventListener("unhandledrejection", ({ reason }) => notice(`Fault of the page: ${reason?.message ?? reason}`, "error", "Reload the page; please report it."));
}

function begin() {
  theme();
  reportFaults();
  $("waiting").remove(); // what an old browser keeps, which gets no further than the page's text
  rig.mount($("rig"));
  addView("live", "Live", live.make);
  addView("depth", "Depth", (host) => depth.make(host, (name) => current === "depth" && history.replaceState(null, "", `#depth/${encodeURIComponent(name)}`)));
  addView("optics", "Optics", lens.make);
  addView("captures", "Captures", (host) => sessions.make(host, (name) => go("depth", name)));
  addView("quality", "Quality", quality.make);
  addView("guides", "Guides", guides.make);
  addView("log", "Log", log.make);
  $("tabs").addEventListener("keydown", tabKeys);
  $("stop").addEventListener("click", stop);
  // The link's address would leave the view.
  document.querySelector(".skip")?.addEventListener("click", (event) => { event.preventDefault(); $("view").focus(); });
  $("theme").addEventListener("click", turnTheme);
  $("keys").addEventListener("click", help);
  key("t", "Light or dark", turnTheme);
  const { parts } = views.get("depth");
  whenCaptured(
    (name) => { go("depth", name); parts.open(name, true); },
    (header, pixels) => { parts.fresh(header, pixels); go("depth", header.capture); },
  );
  on("link", () => { showLink(); if (store.state) { showControl(store.state); showQuestions(store.state); } });
  on("state", (state, before) => {
    showLink();
    showControl(state);
    showAlarm(state);
    showJob(state, before);
    showQuestions(state);
  });
  ignoreMarked();
  listen();
  open();
  const addressed = (back) => {
    const [name, detail] = location.hash.slice(1).split("/");
    go(name || "live", detail && decoded(detail), back);
  };
  addEventListener("popstate", () => addressed(true));
  addressed(false);
}

// Paint the static page before its views are built.
requestAnimationFrame(() => setTimeout(begin));
export { help };
