// Where the model lies: its middle (the pivot) in the world, its scale, its heading and two tilts.
//
// R = Rx(tilt about east) Ry(tilt about north) Rz(-heading) B, where B is the rotation at the start,
// which turns the model's up direction up. A point p comes to s R (p - pivot) + place. Angles are in
// degrees, the heading is clockwise as on a compass. Places are counted from the origin of the map.

const RAD = Math.PI / 180;

export class Placement {
  /** `start` is a similarity { scale, rotation, translation } from the model to the world. */
  constructor(start, pivot) {
    this.pivot = pivot;
    this.base = start.rotation;
    this.set(start);
  }

  /** Takes over a similarity. */
  set({ scale, rotation, translation }) {
    const turned = times(rotation, this.pivot);
    this.place = [0, 1, 2].map((i) => scale * turned[i] + translation[i]);
    this.scale = scale;
    this.setRotation(rotation);
  }

  setRotation(rotation) {
    const q = product(rotation, transposed(this.base));
    this.tiltEast = Math.atan2(-q[1][2], q[2][2]) / RAD;
    this.tiltNorth = Math.asin(Math.min(1, Math.max(-1, q[0][2]))) / RAD;
    this.heading = Math.atan2(q[0][1], q[0][0]) / RAD;
  }

  get rotation() {
    const [a, b, c] = [this.tiltEast, this.tiltNorth, -this.heading].map((angle) => angle * RAD);
    return product(product(aboutX(a), product(aboutY(b), aboutZ(c))), this.base);
  }

  /** The similarity for the program. */
  get similarity() {
    const rotation = this.rotation;
    const turned = times(rotation, this.pivot);
    return { scale: this.scale, rotation, translation: [0, 1, 2].map((i) => this.place[i] - this.scale * turned[i]) };
  }

  /** Returns the rows of the map from offsets to the pivot in the model to places in the world. */
  get rows() {
    return this.rotation.map((row, i) => [...row.map((c) => c * this.scale), this.place[i]]);
  }

  /** Returns where a point of the model lies in the world. */
  apply(point) {
    const offset = [0, 1, 2].map((i) => point[i] - this.pivot[i]);
    return this.rows.map((row) => row[0] * offset[0] + row[1] * offset[1] + row[2] * offset[2] + row[3]);
  }

  /** Returns the rows of the map from places in the world to offsets to the pivot in the model. */
  get rowsBack() {
    const back = transposed(this.rotation).map((row) => row.map((c) => c / this.scale));
    const moved = times(back, this.place);
    return back.map((row, i) => [...row, -moved[i]]);
  }

  /** Turns the model as it lies about its pivot: "x" east, "y" north, "z" up; degrees. */
  turn(axis, degrees) {
    const about = { x: aboutX, y: aboutY, z: aboutZ }[axis];
    this.setRotation(product(about(degrees * RAD), this.rotation));
  }

  get state() {
    const { place, scale, heading, tiltEast, tiltNorth } = this;
    return { place: [...place], scale, heading, tiltEast, tiltNorth };
  }

  set state(state) {
    Object.assign(this, state, { place: [...state.place] });
  }
}

function aboutX(a) {
  const [s, c] = [Math.sin(a), Math.cos(a)];
  return [[1, 0, 0], [0, c, -s], [0, s, c]];
}

function aboutY(a) {
  const [s, c] = [Math.sin(a), Math.cos(a)];
  return [[c, 0, s], [0, 1, 0], [-s, 0, c]];
}

function aboutZ(a) {
  const [s, c] = [Math.sin(a), Math.cos(a)];
  return [[c, -s, 0], [s, c, 0], [0, 0, 1]];
}

export function product(a, b) {
  return a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));
}

export function transposed(a) {
  return [0, 1, 2].map((i) => a.map((row) => row[i]));
}

export function times(a, v) {
  return a.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
}

/** Returns the rows of an affine map (outer) after another one (inner); both are 3 rows of 4. */
export function after(outer, inner) {
  return outer.map((o) => [0, 1, 2, 3].map((j) => o[0] * inner[0][j] + o[1] * inner[1][j] + o[2] * inner[2][j] + (j === 3 ? o[3] : 0)));
}
