// Elements.

export const byId = id => document.getElementById(id);

export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "text") element.textContent = value;
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

// What draws on a canvas; null in a browser without one, and where the reader has blocked it.
export function context2d(canvas) {
  try {
    return canvas.getContext("2d");
  } catch {
    return null;
  }
}

// Whether the reader has asked the system for pictures that do not move by themselves.
export const PREFERS_NO_MOTION = matchMedia("(prefers-reduced-motion: reduce)").matches;

// The key to a chart's marks: of each the class that draws it, and its meaning.
export function legend(entries) {
  return make("span", { class: "legend" }, ...entries.map(([kind, text]) => make("span", {}, make("i", { class: `key ${kind}` }), text)));
}

// A list of choices: [[value, text]].
export function select(label, options, value, act) {
  const list = make("select", { onchange: () => act(list.value) });
  for (const [key, text] of options) list.add(new Option(text, key));
  list.value = value;
  return make("label", {}, `${label} `, list);
}
