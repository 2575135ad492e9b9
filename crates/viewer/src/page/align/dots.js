// Points as small squares, the nearest in front. They are drawn into the pixels of a canvas, which
// takes a few milliseconds for a hundred thousand and needs no WebGL.
//
// A projection is three rows of four numbers. Applied to a point they give column, row and depth, in
// pixels of the page; for a pinhole, column and row times the depth. Less depth is nearer.

export class Dots {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
  }

  /** Fits the canvas to its place on the page and clears it. */
  begin() {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
    if (!this.image || this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
      this.image = this.context.createImageData(width, height);
      this.pixels = new Uint32Array(this.image.data.buffer);
      this.depths = new Float32Array(width * height);
    }
    this.ratio = ratio;
    this.pixels.fill(0);
    this.depths.fill(Infinity);
  }

  /** Draws a cloud: its `points` (x, y, z), `colours` (0xAABBGGRR), and a test of its depths. */
  draw({ points, colours }, projection, { size = 2, isPinhole = false, only = null, behind = 0 } = {}) {
    const { width, height } = this.canvas;
    const [r0, r1, r2] = projection;
    const side = Math.max(1, Math.round(size * this.ratio));
    const half = side / 2;
    for (let i = 0, n = colours.length; i < n; i++) {
      const [x, y, z] = [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
      const depth = r2[0] * x + r2[1] * y + r2[2] * z + r2[3];
      if (only && !only(depth)) continue;
      let column = r0[0] * x + r0[1] * y + r0[2] * z + r0[3];
      let row = r1[0] * x + r1[1] * y + r1[2] * z + r1[3];
      if (isPinhole) {
        if (depth <= 0) continue;
        column /= depth;
        row /= depth;
      }
      const left = Math.round(column * this.ratio - half);
      const top = Math.round(row * this.ratio - half);
      // Also false for numbers that are none.
      if (!(left > -side && left < width && top > -side && top < height)) continue;
      for (let v = Math.max(0, top); v < Math.min(height, top + side); v++) {
        for (let u = Math.max(0, left); u < Math.min(width, left + side); u++) {
          const at = v * width + u;
          if (depth + behind < this.depths[at]) {
            this.depths[at] = depth + behind;
            this.pixels[at] = colours[i];
          }
        }
      }
    }
  }

  /** Shows what was drawn, and returns the context for lines over it, in pixels of the page. */
  end() {
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.putImageData(this.image, 0, 0);
    this.context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    return this.context;
  }
}

/**
 * Returns the number of the point that is drawn at most `radius` pixels from a position; among
 * those about as near, the one in front. -1 for none.
 */
export function nearest({ points, colours }, [r0, r1, r2], at, radius, isPinhole = false) {
  const found = [];
  for (let i = 0, n = colours.length; i < n; i++) {
    const [x, y, z] = [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
    const depth = r2[0] * x + r2[1] * y + r2[2] * z + r2[3];
    if (isPinhole && depth <= 0) continue;
    const k = isPinhole ? depth : 1;
    const away = Math.hypot((r0[0] * x + r0[1] * y + r0[2] * z + r0[3]) / k - at[0], (r1[0] * x + r1[1] * y + r1[2] * z + r1[3]) / k - at[1]);
    if (away <= radius) found.push({ i, away, depth });
  }
  if (!found.length) return -1;
  const least = Math.min(...found.map((one) => one.away));
  const near = found.filter((one) => one.away <= least + 2);
  return near.reduce((best, one) => (one.depth < best.depth ? one : best)).i;
}
