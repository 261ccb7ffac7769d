// A small picture of up to 256 colours as a data URL, written without a canvas so that --svg has it too: the format's
// chunks, with zlib's "stored" blocks, which browsers and readers of SVG take like any other.
const table = [];
for (let n = 0; n < 256; ++n) {
  let c = n;
  for (let k = 0; k < 8; ++k) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  table.push(c >>> 0);
}

const bigEndian = (value) => [(value >>> 24) & 255, (value >>> 16) & 255, (value >>> 8) & 255, value & 255];

function chunk(type, bytes) {
  const body = [type.charCodeAt(0), type.charCodeAt(1), type.charCodeAt(2), type.charCodeAt(3)].concat(bytes);
  let crc = 0xffffffff;
  for (let i = 0; i < body.length; ++i) crc = table[(crc ^ body[i]) & 255] ^ (crc >>> 8);
  return bigEndian(bytes.length).concat(body, bigEndian((crc ^ 0xffffffff) >>> 0));
}

function zlib(bytes) {
  const out = [0x78, 0x01];
  for (let from = 0; from < bytes.length || from === 0; from += 65535) {
    const to = Math.min(from + 65535, bytes.length), size = to - from;
    out.push(to === bytes.length ? 1 : 0, size & 255, size >>> 8, ~size & 255, (~size >>> 8) & 255);
    for (let i = from; i < to; ++i) out.push(bytes[i]);
  }
  let a = 1, b = 0;
  for (let i = 0; i < bytes.length; ++i) {
    a = (a + bytes[i]) % 65521;
    b = (b + a) % 65521;
  }
  return out.concat(bigEndian(((b << 16) | a) >>> 0));
}

function base64(bytes) {
  const letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const parts = [];
  for (let i = 0; i < bytes.length; i += 3) {
    const [a, b, c] = [bytes[i], bytes[i + 1] || 0, bytes[i + 2] || 0];
    parts.push(letters[a >> 2], letters[((a & 3) << 4) | (b >> 4)],
               i + 1 < bytes.length ? letters[((b & 15) << 2) | (c >> 6)] : "=", i + 2 < bytes.length ? letters[c & 63] : "=");
  }
  return parts.join("");
}

/// `rows` of indices into `palette` ([red, green, blue] each), the top row first.
export function pngUrl(rows, palette) {
  const width = rows[0].length, bytes = [];
  for (const row of rows) {
    bytes.push(0);  // no filter
    for (let i = 0; i < width; ++i) bytes.push(row[i]);
  }
  const colours = palette.reduce((all, colour) => all.concat(colour), []);
  const file = [137, 80, 78, 71, 13, 10, 26, 10].concat(
    chunk("IHDR", bigEndian(width).concat(bigEndian(rows.length), [8, 3, 0, 0, 0])), chunk("PLTE", colours),
    chunk("IDAT", zlib(bytes)), chunk("IEND", []));
  return `data:image/png;base64,${base64(file)}`;
}
