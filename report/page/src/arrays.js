// Numbers travel as deflated little-endian bytes in base64, so that a picture with its spectra fits into the page.

const kReaders = {
  f32: (buffer) => new Float32Array(buffer),
  u8: (buffer) => new Uint8Array(buffer),
  f16: (buffer) => Float32Array.from(new Uint16Array(buffer), halfToNumber),
};

function halfToNumber(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

// {type, shape, data, scale} -> {shape, values}; values are multiplied by scale.
export async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  const values = kReaders[packed.type](await new Response(stream).arrayBuffer());
  const scale = packed.scale ?? 1;
  if (scale !== 1) for (let i = 0; i < values.length; ++i) values[i] *= scale;
  return {shape: packed.shape, values};
}

// Spectra as a few basis spectra and their weights in every pixel.
export async function unpackSpectra(packed) {
  const [basis, weights] = await Promise.all([unpack(packed.basis), unpack(packed.weights)]);
  const [height, width, rank] = weights.shape;
  const bands = basis.shape[1];
  return {
    wavelength: packed.wavelength_nm,
    at(row, column, imageHeight, imageWidth) {
      const r = Math.min(height - 1, Math.floor((row * height) / imageHeight));
      const c = Math.min(width - 1, Math.floor((column * width) / imageWidth));
      const spectrum = new Array(bands).fill(0);
      for (let k = 0; k < rank; ++k) {
        const weight = weights.values[(r * width + c) * rank + k];
        for (let b = 0; b < bands; ++b) spectrum[b] += weight * basis.values[k * bands + b];
      }
      return spectrum;
    },
  };
}
