import {numberFrom} from './environment';

/** Reproducible random numbers. Prints its seed, which STRIDEWIRE_SEED overrides. */
export class Random {
  private state: number;
  readonly seed: number;

  constructor(what: string) {
    this.seed = numberFrom('STRIDEWIRE_SEED', Math.floor(Math.random() * 2 ** 32));
    this.state = this.seed >>> 0;
    console.log(`${what}: STRIDEWIRE_SEED=${this.seed}`);
  }

  /** Returns a number in [0, 1). */
  uniform(): number {
    this.state = (this.state + 0x9e3779b9) >>> 0;
    let z = this.state;
    z = Math.imul(z ^ (z >>> 16), 0x21f0aaad);
    z = Math.imul(z ^ (z >>> 15), 0x735a2d97);
    return ((z ^ (z >>> 15)) >>> 0) / 0x1_0000_0000;
  }

  /** Returns an integer in [0, end). */
  below(end: number): number {
    return Math.floor(this.uniform() * end);
  }

  unitQuaternion(): [number, number, number, number] {
    for (;;) {
      const q = [0, 1, 2, 3].map(() => 2 * this.uniform() - 1);
      const length = Math.hypot(...q);
      if (length > 0.1 && length <= 1) {
        return q.map((c) => c / length) as [number, number, number, number];
      }
    }
  }
}
