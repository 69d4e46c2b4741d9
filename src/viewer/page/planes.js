// Images as numbers. Each is decoded when it is first looked at.

const decoded = new Map();

/** The numbers of an image, as a promise. */
function plane(id) {
  if (!decoded.has(id)) decoded.set(id, decode(id));
  return decoded.get(id);
}

async function decode(id) {
  const packed = Uint8Array.from(atob(byId(`plane-${id}`).textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const n = bytes.length / 4;
  const whole = new DataView(new ArrayBuffer(bytes.length));
  const values = new Float32Array(n);
  for (let i = 0; i < n; i++) {
    for (let b = 0; b < 4; b++) whole.setUint8(4 * i + b, bytes[b * n + i]);
    values[i] = whole.getFloat32(4 * i, true);
  }
  const { width, height } = data.planes[id];
  return { width, height, values };
}

/** Test less reference. */
function difference(test, reference) {
  const values = test.values.map((v, i) => v - reference.values[i]);
  return { width: test.width, height: test.height, values };
}
