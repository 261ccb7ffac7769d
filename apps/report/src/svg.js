// The figures without a browser, for `rhec report --svg`: a document's text in, [{name, svg}] as text out. Every figure
// gets its title, in text that stays text.
import "./polyfill.js";
import {init, setPlatformAPI} from "./echarts.js";
import {firstState, sectionsOf, told} from "./figures/index.js";
import {paper} from "./look.js";
import {variantsForPaper} from "./paper.js";

const WIDTH = 760, HEAD = 30;

// There is no font to measure: about the widths of DejaVu Sans, which is wider than most.
const widths = (letter) => (/[ijl.,:;'|!]/.test(letter) ? 0.3 : /[ftr ()\[\]]/.test(letter) ? 0.4 : /[mwMW%@]/.test(letter) ? 0.95 : 0.63);
setPlatformAPI({measureText: (text, font) => {
  const size = parseFloat((/(\d+(\.\d+)?)px/.exec(font || "") || [0, "12"])[1]);
  return {width: String(text).split("").reduce((sum, letter) => sum + widths(letter), 0) * size};
}});

const escaped = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;").replace(/"/g, "&quot;");

function drawn(figure, state) {
  const height = figure.height(WIDTH, state), title = told(figure.title, state), caption = told(figure.caption, state);
  const chart = init(null, null, {renderer: "svg", ssr: true, width: WIDTH, height});
  chart.setOption(figure.option(paper, {width: WIDTH, height, state, view: null}));
  const inner = chart.renderToSVGString().replace(/^<svg /, `<svg y="${HEAD}" `);
  chart.dispose();
  return `<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" width="${WIDTH}" height="${height + HEAD}" ` +
    `viewBox="0 0 ${WIDTH} ${height + HEAD}" role="img">\n<title>${escaped(title)}</title>\n<desc>${escaped(caption)}</desc>\n` +
    `<rect width="100%" height="100%" fill="#ffffff"/>\n<text x="${WIDTH / 2}" y="20" text-anchor="middle" font-family="${escaped(paper.font)}" ` +
    `font-size="${title.length > 95 ? 11 : 14}" font-weight="600" fill="#000000">${escaped(title)}</text>\n${inner}\n</svg>\n`;
}

globalThis.drawFigures = (text) => {
  const document = JSON.parse(text), state = firstState(document), files = [];
  for (const section of sectionsOf(document))
    for (const figure of section.figures)
      for (const variant of variantsForPaper(document, figure, state)) files.push({name: variant.name, svg: drawn(figure, variant.state)});
  return JSON.stringify(files);
};
