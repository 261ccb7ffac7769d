// node build.mjs <folder with node_modules> <folder for the results>: the parts of `rhec report` that are script and style.
import {mkdirSync, readFileSync, writeFileSync} from "node:fs";
import {createRequire} from "node:module";
import {dirname, join, resolve} from "node:path";
import {fileURLToPath} from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const [modules, results] = process.argv.slice(2).map((folder) => resolve(folder));
const require = createRequire(join(modules, "package.json"));
const esbuild = require("esbuild");
const typescript = require("typescript");

const sources = (name) => join(here, "src", name);
const inModules = (name) => join(modules, "node_modules", name);

async function bundle(entry, options) {
  const result = await esbuild.build({entryPoints: [sources(entry)], bundle: true, write: false, minify: true, format: "iife", legalComments: "none",
    charset: "ascii", nodePaths: [join(modules, "node_modules")], define: {"process.env.NODE_ENV": '"production"'}, logLevel: "warning", ...options});
  return result.outputFiles[0].text;
}

/// ECMAScript 5, which is what Duktape runs; esbuild does not go that far back, TypeScript's compiler does.
async function toEcmaScript5(text) {
  const {outputText, diagnostics} = typescript.transpileModule(text, {
    reportDiagnostics: true, compilerOptions: {target: typescript.ScriptTarget.ES5, module: typescript.ModuleKind.CommonJS, removeComments: true}});
  if (diagnostics.length) throw new Error(diagnostics.map(({messageText}) => typescript.flattenDiagnosticMessageText(messageText, "\n")).join("\n"));
  // Not minifySyntax: it moves declarations into heads of `for`, where Duktape does not take an `in` in brackets.
  return (await esbuild.transform(outputText, {minifyWhitespace: true, minifyIdentifiers: true, target: "es5", charset: "ascii"})).code;
}

/// The licences of all that is in the bundles, in full.
function licences() {
  return [["echarts", "LICENSE", "NOTICE"], ["zrender", "LICENSE"], ["tslib", "LICENSE.txt"]].map(([name, ...files]) => {
    const {version, license} = JSON.parse(readFileSync(join(inModules(name), "package.json"), "utf8"));
    return [`${name} ${version} (${license})`, ...files.map((file) => readFileSync(join(inModules(name), file), "utf8").trim())].join("\n\n");
  }).join(`\n\n${"-".repeat(72)}\n\n`) + "\n";
}

const inMarkup = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const inScript = (text) => text.replace(/<\/(script)/gi, "<\\/$1").replace(/<!--/g, "<\\!--");

const texts = licences();
const style = (await esbuild.build({entryPoints: [sources("page.css")], minify: true, write: false})).outputFiles[0].text;
const parts = {style, licences: inMarkup(texts), script: inScript(await bundle("page/main.js", {target: "es2020"}))};
const page = readFileSync(sources("page.html"), "utf8").replace(/\{\{(style|licences|script)\}\}/g, (_, name) => parts[name]);
if (page.split("{{document}}").length !== 2) throw new Error("page.html must have one place for the document");

mkdirSync(results, {recursive: true});
writeFileSync(join(results, "page.html"), page);
writeFileSync(join(results, "figures.js"), await toEcmaScript5(await bundle("svg.js", {target: "es2018", minify: false})));
writeFileSync(join(results, "licences.txt"), texts);
