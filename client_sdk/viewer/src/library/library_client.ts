// What the animator's page asks of the server: libraries, groups, steps of any parameters, and how far
// they miss what was asked.

import type {LegLike, SkeletonLike} from '../scene/body_parts.js';

export interface GroupEntry {
  readonly kind: string;
  readonly parameters: readonly string[];
  readonly examples: number;
  readonly pseudoexamples: number;
}
export interface LibraryEntry {
  readonly name: string;
  readonly hash: string;
  readonly groups: readonly GroupEntry[];
}
export interface Parameter {
  readonly name: string;
  readonly min: number;
  readonly max: number;
}
export interface Site {
  readonly p: readonly number[];
  readonly is_example: boolean;
  readonly source?: string;
  readonly mirrored?: boolean;
}
export interface Group {
  readonly kind: string;
  readonly parameters: readonly Parameter[];
  readonly sites: readonly Site[];
}
/** A movement as frames, from its base frame. */
export interface Clip {
  readonly times_s: readonly number[];
  readonly roots_m: readonly number[];    // 3 a frame
  readonly rotations: readonly number[];  // 4 a joint and frame
  readonly keytimes_s: readonly number[];
  readonly heading_change_rad: number;
  readonly weights: readonly number[];
  readonly weight_sum: number;
  readonly applied: readonly number[];
  readonly measured: readonly number[];
}
export interface Step extends Clip {
  readonly requested: readonly number[];
  readonly error_m: number;
  readonly uncorrected_error_m: number;
  readonly iterations: number;
  readonly extrapolated: boolean;
}
/** Cells from the lowest y up, each row from the lowest x; null where requests do not get. */
export interface ErrorMap {
  readonly x: readonly [number, number];
  readonly y: readonly [number, number];
  readonly cells: number;
  readonly errors_mm: readonly (number | null)[];
  readonly largest_m: number;
}

interface SkeletonMessage {
  readonly names: readonly string[];
  readonly parents: readonly number[];
  readonly offsets_m: readonly number[];
  readonly end_sites: readonly {readonly joint: number; readonly offset_m: readonly number[]}[];
  readonly legs: readonly {
    readonly hip: number; readonly knee: number; readonly ankle: number; readonly ball: number;
    readonly ball_offset_m: readonly number[]; readonly toe_tip_offset_m: readonly number[];
  }[];
}

export class LibrarySource {
  /** `base`: "" for the server this page came from, else "http://host:port". */
  constructor(private readonly base: string) {}

  libraries(): Promise<LibraryEntry[]> {
    return this.get('/libraries.json');
  }

  async skeleton(hash: string): Promise<SkeletonLike> {
    const it = await this.get<SkeletonMessage>(`/libraries/${hash}/skeleton.json`);
    const [left, right] = it.legs.map((leg): LegLike => ({
      hip: leg.hip, knee: leg.knee, ankle: leg.ankle, ball: leg.ball,
      ballOffsetM: leg.ball_offset_m, toeTipOffsetM: leg.toe_tip_offset_m,
    }));
    return {
      jointCount: it.names.length, names: it.names, parents: it.parents, offsetsM: it.offsets_m,
      endSites: it.end_sites.map(({joint, offset_m}) => ({joint, offsetM: offset_m})),
      leftLeg: left!, rightLeg: right!,
    };
  }

  group(hash: string, group: number): Promise<Group> {
    return this.get(`/libraries/${hash}/${group}/sites.json`);
  }
  step(hash: string, group: number, p: readonly number[], corrected: boolean): Promise<Step> {
    return this.get(`/libraries/${hash}/${group}/step.json?p=${text(p)}&correction=${+corrected}`);
  }
  example(hash: string, group: number, index: number): Promise<Clip> {
    return this.get(`/libraries/${hash}/${group}/example.json?index=${index}`);
  }
  errors(
    hash: string, group: number, x: number, y: number, p: readonly number[], cells: number,
    corrected: boolean): Promise<ErrorMap> {
    return this.get(`/libraries/${hash}/${group}/errors.json?x=${x}&y=${y}&p=${text(p)}` +
      `&cells=${cells}&correction=${+corrected}`);
  }

  private async get<T>(path: string): Promise<T> {
    let response: Response;
    try {
      response = await fetch(this.base + path);
    } catch {
      throw new Error('No server answers: start stridewired, then reload this page.');
    }
    if (!response.ok) throw new Error((await response.text()).trim());
    return await response.json() as T;
  }
}

function text(p: readonly number[]): string {
  return p.map((value) => value.toFixed(5)).join(',');
}

/** Asks for the newest of what is wanted, one at a time: what came in between is left out. */
export class Latest<Wish> {
  private waiting: Wish | null = null;
  private busy = false;

  constructor(
    private readonly work: (wish: Wish) => Promise<void>,
    private readonly failed: (error: Error) => void) {}

  want(wish: Wish): void {
    this.waiting = wish;
    if (!this.busy) void this.run();
  }

  private async run(): Promise<void> {
    this.busy = true;
    while (this.waiting !== null) {
      const wish = this.waiting;
      this.waiting = null;
      try {
        await this.work(wish);
      } catch (error) {
        this.failed(error as Error);
      }
    }
    this.busy = false;
  }
}
