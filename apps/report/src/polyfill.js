// What Duktape lacks of the language that the figures are written in.
const define = (owner, name, value) => {
  if (!owner[name]) Object.defineProperty(owner, name, {value, writable: true, configurable: true});
};
const root = typeof globalThis === "undefined" ? Function("return this")() : globalThis;
define(root, "globalThis", root);
define(root, "console", {log() {}, warn() {}, error() {}});
define(root, "setTimeout", () => 0);
define(root, "clearTimeout", () => {});
define(Object, "assign", (target, ...sources) => {
  for (const source of sources) if (source) for (const key of Object.keys(source)) target[key] = source[key];
  return target;
});
define(Array.prototype, "find", function (test) {
  for (let i = 0; i < this.length; ++i) if (test(this[i], i, this)) return this[i];
  return undefined;
});
define(Array.prototype, "findIndex", function (test) {
  for (let i = 0; i < this.length; ++i) if (test(this[i], i, this)) return i;
  return -1;
});
define(Array.prototype, "fill", function (value) {
  for (let i = 0; i < this.length; ++i) this[i] = value;
  return this;
});
