// Files to open: meshes in every format, large ones, and pictures.

import { crc32, deflateSync } from "node:zlib";

const CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1.4, 0], [0, 0, 0.7]];
const FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
const text = (lines) => Buffer.from(`${lines.join("\n")}\n`);

/** A tetrahedron, by the ending of the name of its file. */
export const meshes = {
  obj: text([...CORNERS.map((p) => `v ${p.join(" ")}`), ...FACES.map((face) => `f ${face.map((k) => k + 1).join(" ")}`)]),
  ply: text(["ply", "format ascii 1.0", "element vertex 4", "property float x", "property float y", "property float z", "element face 4", "property list uchar int vertex_indices", "end_header", ...CORNERS.map((p) => p.join(" ")), ...FACES.map((face) => `3 ${face.join(" ")}`)]),
  stl: text(["solid a", ...FACES.flatMap((face) => ["facet normal 0 0 0", "outer loop", ...face.map((k) => `vertex ${CORNERS[k].join(" ")}`), "endloop", "endfacet"]), "endsolid a"]),
};

/** A wavy sheet of a million faces, as a binary PLY. */
export function large() {
  const [columns, rows] = [1001, 501];
  const head = Buffer.from(`ply\nformat binary_little_endian 1.0\nelement vertex ${columns * rows}\nproperty float x\nproperty float y\nproperty float z\nelement face 1000000\nproperty list uchar int vertex_indices\nend_header\n`);
  const vertices = new Float32Array(columns * rows * 3);
  for (let k = 0; k < columns * rows; k++) {
    const [x, y] = [k % columns, Math.floor(k / columns)];
    vertices.set([x / 500, y / 500, 0.2 * Math.sin(x / 60) * Math.cos(y / 60)], 3 * k);
  }
  const faces = Buffer.alloc(1_000_000 * 13);
  let at = 0;
  for (let y = 0; y + 1 < rows; y++) {
    for (let x = 0; x + 1 < columns; x++) {
      const k = y * columns + x;
      for (const corners of [[k, k + 1, k + columns], [k + 1, k + columns + 1, k + columns]]) {
        at = faces.writeUInt8(3, at);
        for (const corner of corners) at = faces.writeInt32LE(corner, at);
      }
    }
  }
  return Buffer.concat([head, Buffer.from(vertices.buffer), faces]);
}

/** A gray PNG, whose level from 0 to 255 at [x, y] `of` says. */
export function png(width, height, of) {
  const rows = Buffer.alloc((width + 1) * height);
  for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) rows[y * (width + 1) + 1 + x] = of(x, y);
  const chunk = (name, data) => {
    const body = Buffer.concat([Buffer.from(name), data]);
    const [length, sum] = [Buffer.alloc(4), Buffer.alloc(4)];
    length.writeUInt32BE(data.length);
    sum.writeUInt32BE(crc32(body));
    return Buffer.concat([length, body, sum]);
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 0, 0, 0, 0], 8);
  return Buffer.concat([Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]), chunk("IHDR", head), chunk("IDAT", deflateSync(rows, { level: 1 })), chunk("IEND", Buffer.alloc(0))]);
}

/** A disc in the middle of a picture. */
export const disc = (width, height) => png(width, height, (x, y) => (Math.hypot(x - width / 2, y - height / 2) < height / 3 ? 255 : 0));
