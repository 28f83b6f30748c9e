// Saves charts as SVG and PNG, and tables as CSV. A picture is drawn anew: in the colours of paper, with its label and its keys below it.

import * as echarts from "echarts/core";
import { csvText } from "./csv.js";
import { make } from "../../figures/web/dom.js";

// The fonts of study.css by name, because ECharts measures no text of an inherited font.
export const FONT = "DejaVu Sans, Arial, Helvetica, sans-serif";
// Width of a chart that is not shown, margin, height of a line, size of a key (px).
const WIDTH = 800, MARGIN = 12, LINE = 18, KEY = 11;
const PNG_SCALE = 2;
// Saving goes on after the click.
const KEEP_MS = 60000;
const study = { title: "", stem: "" };

const nameOf = text => text.toLowerCase().replace(/\.json5?(?= |$)/, "").replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").slice(0, 60);

// The study, and the experiment if there are several, of which the following files are.
export function nameFiles({ study: { title, experiments }, e }) {
  const several = experiments.length > 1;
  Object.assign(study, { title: several ? `${title}, experiment ${e.id}` : title, stem: nameOf(several ? `${title} ${e.id}` : title) });
}

function save(blob, name, ending) {
  const link = make("a", { href: URL.createObjectURL(blob), download: [study.stem, nameOf(name)].filter(Boolean).join("-") + ending });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), KEEP_MS);
}

// A button that saves table(): {head, rows} as CSV.
export const csvButton = (label, name, table, text = "CSV") => make("button", {
  type: "button", text, "aria-label": `save as CSV: ${label}`, onclick: () => save(new Blob([csvText(table())], { type: "text/csv" }), name, ".csv"),
});

// The buttons under a chart. colours(): those of paper.
export function chartButtons(chart, colours) {
  const { label, name, numbers } = chart, bar = make("span", { class: "save" }, "save as ");
  const button = (text, act) => make("button", { type: "button", text, "aria-label": `save as ${text}: ${label}`, onclick: async () => {
    try { await act(); } catch ({ message }) { bar.replaceChildren(`This browser cannot save the chart (${message}).`); }
  } });
  bar.append(
    button("SVG", () => save(new Blob([svgOf(chart, colours())], { type: "image/svg+xml" }), name, ".svg")),
    button("PNG", async () => save(await pngOf(chart, colours()), name, ".png")), ...(numbers ? [csvButton(label, name, numbers)] : []),
  );
  return bar;
}

function svgOf(chart, theme) {
  const picture = drawing(chart, theme, size => echarts.init(null, null, { ...size, renderer: "svg", ssr: true }));
  try { return picture.renderToSVGString(); } finally { picture.dispose(); }
}

async function pngOf(chart, theme) {
  const picture = drawing(chart, theme, size => echarts.init(make("div"), null, { ...size, renderer: "canvas", devicePixelRatio: PNG_SCALE }));
  try {
    picture.getZr().flush();
    const canvas = picture.renderToCanvas({ pixelRatio: PNG_SCALE, backgroundColor: theme.paper });
    const blob = await new Promise(go => canvas.toBlob(go, "image/png"));
    if (!blob) throw new Error("it made no PNG");
    return blob;
  } finally { picture.dispose(); }
}

function drawing({ option, label, keys, place, complete }, theme, init) {
  const width = place.clientWidth || WIDTH, { height, ...rest } = option(theme, width), picture = init({ width, height });
  picture.setOption({ animation: false, backgroundColor: theme.paper, textStyle: { fontFamily: FONT, color: theme.ink }, ...rest });
  complete(picture);
  const marks = caption(`${study.title}: ${label}`, keys(theme), theme, width, height), bottom = Math.max(...marks.map(mark => mark.getBoundingRect().y + mark.getBoundingRect().height));
  // Below the chart, whose size stays.
  picture.getZr().resize({ width, height: Math.ceil(bottom) + MARGIN });
  for (const mark of marks) picture.getZr().add(mark);
  return picture;
}

// Keys in lines, and the label below them.
function caption(label, keys, theme, width, top) {
  const text = (words, x, y, more = {}) => new echarts.graphic.Text({ style: { text: words, x, y, font: `12px ${FONT}`, fill: theme.ink, verticalAlign: "top", lineHeight: LINE, ...more } });
  const marks = [];
  let x = MARGIN, y = top + 4;
  for (const { shape, colour, text: words } of keys) {
    const name = text(words, 0, 0), needed = KEY + 6 + name.getBoundingRect().width;
    if (x > MARGIN && x + needed > width - MARGIN) [x, y] = [MARGIN, y + LINE];
    name.attr({ style: { x: x + KEY + 6, y } });
    marks.push(keyMark(shape, colour, x, y + 2), name);
    x += needed + 18;
  }
  marks.push(text(label, MARGIN, keys.length ? y + LINE + 4 : y, { fill: theme.soft, width: width - 2 * MARGIN, overflow: "break" }));
  return marks;
}

// shape: dot, diamond, box (filled), frame, line or dashed.
function keyMark(shape, colour, x, y) {
  const { Circle, Line, Polygon, Rect } = echarts.graphic, half = KEY / 2, [cx, cy] = [x + half, y + half];
  if (shape === "dot") return new Circle({ shape: { cx, cy, r: half - 1 }, style: { fill: colour } });
  if (shape === "diamond") return new Polygon({ shape: { points: [[cx, y], [x + KEY, cy], [cx, y + KEY], [x, cy]] }, style: { fill: colour } });
  if (shape === "line" || shape === "dashed" || shape === "dotted") return new Line({ shape: { x1: x, x2: x + KEY + 2, y1: cy, y2: cy }, style: { stroke: colour, lineWidth: 1.5, lineDash: shape === "line" ? "solid" : shape } });
  return new Rect({ shape: { x: x + 1, y: y + 1, width: KEY - 2, height: KEY - 2 }, style: shape === "frame" ? { fill: null, stroke: colour, lineWidth: 1.5 } : { fill: colour } });
}
