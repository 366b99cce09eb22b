// Reads SPZ of versions 2 and 3, which are one gzip stream, into the arrays that PlayCanvas takes. Positions, rotations and harmonics keep the
// frame of the file (x right, y up, z back); the page turns them by its entity.

const MAGIC = 0x5053474e;
const COLOUR_SCALE = 0.15;

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function readPositions(bytes, count, bits) {
  const out = [0, 1, 2].map(() => new Float32Array(count));
  const step = 2 ** -bits;
  for (let k = 0, at = 0; k < count; ++k)
    for (let c = 0; c < 3; ++c, at += 3) out[c][k] = ((bytes[at] | (bytes[at + 1] << 8) | (bytes[at + 2] << 16)) << 8 >> 8) * step;
  return out;
}

// w x y z
function readRotations(bytes, count, version) {
  const out = [0, 1, 2, 3].map(() => new Float32Array(count));
  const xyzw = [0, 0, 0, 0];
  for (let k = 0; k < count; ++k) {
    let rest = 1;
    let largest = 3;
    if (version < 3) {
      for (let i = 0; i < 3; ++i) {
        xyzw[i] = bytes[3 * k + i] / 127.5 - 1;
        rest -= xyzw[i] * xyzw[i];
      }
    } else {
      let packed = (bytes[4 * k] | (bytes[4 * k + 1] << 8) | (bytes[4 * k + 2] << 16) | (bytes[4 * k + 3] << 24)) >>> 0;
      largest = packed >>> 30;
      for (let i = 3; i >= 0; --i) {
        if (i === largest) continue;
        const size = (packed & 511) / 511 * Math.SQRT1_2;
        xyzw[i] = packed & 512 ? -size : size;
        rest -= size * size;
        packed >>>= 10;
      }
    }
    xyzw[largest] = Math.sqrt(Math.max(0, rest));
    for (let i = 0; i < 4; ++i) out[i][k] = xyzw[(i + 3) % 4];
  }
  return out;
}

// The bytes of an SPZ file to {count, degree, antialias, properties}: a Float32Array for each property of a PLY of 3D Gaussians.
export async function readSpz(file) {
  const bytes = await inflated(file);
  const head = new DataView(bytes.buffer);
  const version = head.getUint32(4, true);
  if (head.getUint32(0, true) !== MAGIC || version < 2 || version > 3) throw new Error('the scene inside this page is not SPZ of version 2 or 3');
  const count = head.getUint32(8, true);
  const degree = bytes[12];
  const rest = (degree + 1) ** 2 - 1;
  let at = 16;
  const take = (each) => {
    const from = at;
    at += each * count;
    if (at > bytes.length) throw new Error('the scene inside this page is cut off');
    return bytes.subarray(from, at);
  };
  const properties = {};
  readPositions(take(9), count, bytes[13]).forEach((values, c) => (properties['xyz'[c]] = values));
  const alphas = take(1);
  properties.opacity = Float32Array.from(alphas, (a) => {
    const share = Math.min(Math.max(a, 0.25), 254.75) / 255;
    return Math.log(share / (1 - share));
  });
  const colours = take(3);
  const scales = take(3);
  for (let c = 0; c < 3; ++c) {
    properties[`f_dc_${c}`] = Float32Array.from({length: count}, (_, k) => (colours[3 * k + c] / 255 - 0.5) / COLOUR_SCALE);
    properties[`scale_${c}`] = Float32Array.from({length: count}, (_, k) => scales[3 * k + c] / 16 - 10);
  }
  readRotations(take(version < 3 ? 3 : 4), count, version).forEach((values, i) => (properties[`rot_${i}`] = values));
  const sh = take(3 * rest);
  const drawn = Math.min(rest, 15);  // degree 3 is the highest that is drawn
  for (let c = 0; c < 3; ++c)
    for (let i = 0; i < drawn; ++i) {
      const values = new Float32Array(count);
      for (let k = 0; k < count; ++k) values[k] = (sh[3 * (rest * k + i) + c] - 128) / 128;
      properties[`f_rest_${c * drawn + i}`] = values;
    }
  return {count, degree: Math.min(degree, 3), antialias: (bytes[14] & 1) !== 0, properties};
}
