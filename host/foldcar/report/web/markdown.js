// Notes in Markdown as elements: paragraphs, headings, lists, code, emphasis, links to web pages. Everything else is text as written, HTML, too.

import { make } from "../../figures/web/dom.js";

const INLINE = /`([^`]+)`|\*\*(?=\S)(.+?\S?)\*\*|\*(?=[^\s*])([^*]*[^\s*])\*|(?<!\w)_(?=\S)([^_]*[^\s_])_(?!\w)|\[([^\]]+)\]\((https?:\/\/[^\s()]+)\)/gs;
// Longer notes, which only the store of another program has, are shown as they are written (characters).
const MAX_LENGTH = 10000;
const ITEM = /^ {0,3}(?:([-*+])|\d{1,9}[.)])\s+/;

// The elements and texts of a line.
function inline(text) {
  const parts = [];
  let end = 0;
  for (const found of text.matchAll(INLINE)) {
    const [all, code, strong, star, line, words, address] = found;
    parts.push(text.slice(end, found.index), code !== undefined ? make("code", { text: code }) : strong !== undefined ? make("strong", {}, ...inline(strong))
      : words !== undefined ? make("a", { href: address, rel: "noreferrer", target: "_blank" }, ...inline(words)) : make("em", {}, ...inline(star ?? line)));
    end = found.index + all.length;
  }
  return [...parts, text.slice(end)].filter(part => part !== "");
}

// The list of which a line begins an item, or null.
function listTag(line) {
  const item = ITEM.exec(line);
  return item && (item[1] ? "ul" : "ol");
}

function list(lines) {
  const items = [];
  for (const line of lines) {
    if (ITEM.test(line)) items.push(line.replace(ITEM, ""));
    else items[items.length - 1] += ` ${line.trim()}`;
  }
  return make(listTag(lines[0]), {}, ...items.map(item => make("li", {}, ...inline(item))));
}

// The blocks of a text.
export function markdown(text) {
  if (text.length > MAX_LENGTH) return [make("p", { text })];
  const blocks = [], lines = text.split(/\r?\n/);
  let open = [];
  const close = () => {
    if (open.length) blocks.push(ITEM.test(open[0]) ? list(open) : make("p", {}, ...inline(open.join("\n"))));
    open = [];
  };
  for (let k = 0; k < lines.length; k++) {
    const heading = /^ {0,3}#{1,6}\s+(.*?)\s*#*$/.exec(lines[k]);
    if (/^```/.test(lines[k])) {
      const end = lines.findIndex((line, n) => n > k && /^```\s*$/.test(line)), last = end < 0 ? lines.length : end;
      close();
      blocks.push(make("pre", {}, make("code", { text: lines.slice(k + 1, last).join("\n") })));
      k = last;
    } else if (heading || !lines[k].trim()) {
      close();
      if (heading) blocks.push(make("h3", {}, ...inline(heading[1])));
    } else {
      // A list may follow a paragraph or a list of the other kind without an empty line.
      const tag = listTag(lines[k]);
      if (tag && open.length && listTag(open[0]) !== tag) close();
      open.push(lines[k]);
    }
  }
  close();
  return blocks;
}

// Notes on top of a page: the first blocks, up to a paragraph, and the others to be opened.
export function notes(text) {
  const blocks = markdown(text), first = blocks.findIndex(({ tagName }) => tagName !== "H3") + 1 || blocks.length, rest = blocks.slice(first);
  return [...blocks.slice(0, first), ...(rest.length ? [make("details", {}, make("summary", { text: "more about the study" }), ...rest)] : [])];
}
