// The objects of a city model that splats belong to: which one a click meets, and what is known of it.

export class Objects {
  /** Takes the numbers of the objects and classes of all splats, and the table of what they mean. */
  constructor(numbers, table) {
    const count = numbers.byteLength / 5;
    this.objects = new Uint32Array(numbers, 0, count);
    this.classes = new Uint8Array(numbers, 4 * count);
    this.names = table.classes;
    this.missing = table.missing_object;
    this.table = new Map(table.objects.map((one) => [one.number, one]));
    this.buildings = new Map(table.objects.map((one) => [one.id, one]));
  }

  /** Returns what has the greatest weight of the splats on a ray; null where it has no object. */
  met(parts) {
    const sums = new Map();
    for (const [splat, weight] of parts) {
      const key = this.objects[splat] * 256 + this.classes[splat];
      sums.set(key, (sums.get(key) ?? 0) + weight);
    }
    const best = [...sums].reduce((a, b) => (b[1] > a[1] ? b : a), [this.missing * 256, 0])[0];
    const [object, surface] = [Math.floor(best / 256), best % 256];
    return object === this.missing ? null : { object, surface };
  }

  /** Returns the lines of what is known of an object: names and texts. */
  lines({ object, surface }) {
    const found = this.table.get(object);
    const text = (value) => (typeof value === "object" ? JSON.stringify(value) : String(value));
    const attributes = (one) => Object.entries(one?.attributes ?? {}).map(([name, value]) => [name, text(value)]);
    const lines = [["object", found?.id ?? `number ${object}`], ["class", this.names[surface] ?? `number ${surface}`]];
    if (!found) return lines;
    lines.splice(1, 0, ["kind", found.kind]);
    lines.push(...attributes(found));
    if (found.building === found.id) return lines;
    return [...lines, ["building", found.building], ...attributes(this.buildings.get(found.building))];
  }

  /** Returns the number of splats of an object. */
  count(object) {
    return this.objects.reduce((sum, one) => sum + (one === object), 0);
  }
}
