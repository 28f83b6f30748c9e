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

// A list of choices: [[value, text]].
export function select(label, options, value, act) {
  const list = make("select", { onchange: () => act(list.value) });
  for (const [key, text] of options) list.add(new Option(text, key));
  list.value = value;
  return make("label", {}, `${label} `, list);
}
