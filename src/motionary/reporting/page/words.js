// Text, times and small elements. Names come from files of strangers: they become text nodes,
// never markup, and what cannot be seen of them is made visible.

const HIDDEN = /[\u0000-\u001f\u007f-\u009f\u200b-\u200f\u2028-\u202e\u2066-\u2069\ufeff]/g;

function shown(text) {
  return String(text).replace(HIDDEN, "\ufffd");
}

// An element: attributes as text, `on...` as listeners, children as elements or text.
function h(tag, attributes, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  for (const child of children.flat()) {
    if (child === null || child === undefined) continue;
    element.append(child instanceof Node ? child : shown(child));
  }
  return element;
}

function button(text, label, onclick, extra) {
  return h("button", { type: "button", title: label, "aria-label": label, onclick, ...extra }, text);
}

// Something that takes a while: once the browser has shown what is there, and the element is seen.
function onceSeen(element, action) {
  let waits = true;
  const act = () => {
    if (!waits) return;
    waits = false;
    new IntersectionObserver((entries, observer) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      action();
    }).observe(element);
  };
  if ((PerformanceObserver.supportedEntryTypes || []).includes("paint")) new PerformanceObserver(act).observe({ type: "paint", buffered: true });
  // A page that is not in sight is not painted.
  setTimeout(act, 3000);
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

function formatTime(seconds, digits = 2) {
  const minutes = Math.floor(seconds / 60 + 1e-9);
  if (!minutes) return seconds.toFixed(digits);
  const rest = Math.max(seconds - 60 * minutes, 0).toFixed(digits).padStart(digits ? digits + 3 : 2, "0");
  return `${minutes}:${rest}`;
}

// The file's own frame numbers, as motionary counts them.
function frameAt(recording, seconds) {
  const index = Math.floor(seconds * recording.rate_hz + 1e-6);
  return recording.first_frame + clamp(index, 0, Math.max(recording.n_frames - 1, 0));
}

function lastFrameBefore(recording, seconds) {
  const index = Math.ceil(seconds * recording.rate_hz - 1e-6) - 1;
  return recording.first_frame + clamp(index, 0, Math.max(recording.n_frames - 1, 0));
}

function cssColour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// Clipboards are closed to some pages from disk; a selected field works everywhere.
async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const field = h("textarea", { class: "away", "aria-hidden": "true" });
    field.value = text;
    document.body.append(field);
    field.select();
    const done = document.execCommand("copy");
    field.remove();
    return done;
  }
}

function download(name, text) {
  const address = URL.createObjectURL(new Blob([text], { type: "text/csv;charset=utf-8" }));
  const link = h("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

function toCsv(rows) {
  const cell = (value) => {
    const text = String(value);
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return rows.map((row) => row.map(cell).join(",") + "\n").join("");
}

// Light or dark: the system's choice until a person makes another.
function themeButton(onchange) {
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme || (dark.matches ? "dark" : "light")) === "dark";
  dark.addEventListener("change", onchange);
  return button("◐", "Light or dark", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    onchange();
  });
}

function helpButton(keys, text) {
  const help = h("dialog", { class: "help", "aria-label": "Keys" },
    h("h2", {}, "Keys"),
    h("dl", {}, keys.map(([names, what]) => [h("dt", {}, names), h("dd", {}, what)])),
    h("p", { class: "soft" }, text),
    button("Close", "Close", () => help.close()));
  document.body.append(help);
  return button("?", "Keys", () => help.showModal());
}
