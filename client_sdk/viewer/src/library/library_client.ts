// HTTP requests of the library page: libraries, groups of examples, synthesized steps and error
// maps.

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
/** A parameter and its range over the group's examples. */
export interface Parameter {
  readonly name: string;
  readonly min: number;
  readonly max: number;
}
/** An example or pseudoexample as a point in parameter space. */
export interface Site {
  /** Parameters of the site, in the order of `Group.parameters`. */
  readonly p: readonly number[];
  readonly is_example: boolean;
  /** Origin of an example, for example the capture that it was cut from. */
  readonly source?: string;
  readonly mirrored?: boolean;
}
export interface Group {
  readonly kind: string;
  readonly parameters: readonly Parameter[];
  readonly sites: readonly Site[];
}
/** A movement as frames, relative to its base frame. */
export interface Clip {
  readonly times_s: readonly number[];
  /** Root positions, 3 numbers per frame. */
  readonly roots_m: readonly number[];
  /** Quaternions, 4 numbers per joint and frame. */
  readonly rotations: readonly number[];
  readonly keytimes_s: readonly number[];
  readonly heading_change_rad: number;
  readonly weights: readonly number[];
  /** Sum of the absolute weights. */
  readonly weight_sum: number;
  /** Parameters after clamping. */
  readonly applied: readonly number[];
  /** Parameters measured in the synthesized movement. */
  readonly measured: readonly number[];
}
export interface Step extends Clip {
  readonly requested: readonly number[];
  readonly error_m: number;
  readonly uncorrected_error_m: number;
  readonly iterations: number;
  readonly extrapolated: boolean;
}
/** Errors over a plane of two parameters. */
export interface ErrorMap {
  readonly x: readonly [number, number];
  readonly y: readonly [number, number];
  /** Number of cells per side. */
  readonly cells: number;
  /**
   * Rows from the lowest y, each from the lowest x. Null where the server would clamp the
   * parameters, because they are too far outside the hull of the examples.
   */
  readonly errors_mm: readonly (number | null)[];
  readonly largest_m: number;
}

/** Describes what avatars can do with a library. */
export interface Summary {
  readonly summary: {
    /** What avatars can do, in one sentence per class of movements. */
    readonly sentences: readonly string[];
    readonly missing: readonly {readonly what: string; readonly advice: string}[];
  };
  readonly self_check: {
    readonly passed: boolean;
    /** The overall result in one sentence. */
    readonly verdict: string;
    readonly checks: readonly {
      readonly title: string;
      readonly verdict: 'passed' | 'failed' | 'not_applicable';
      readonly text: string;
      readonly advice: string | null;
    }[];
  };
}

interface SkeletonJson {
  readonly names: readonly string[];
  readonly parents: readonly number[];
  readonly offsets_m: readonly number[];
  readonly end_sites: readonly {readonly joint: number; readonly offset_m: readonly number[]}[];
  readonly legs: readonly {
    readonly hip: number; readonly knee: number; readonly ankle: number; readonly ball: number;
    readonly ball_offset_m: readonly number[]; readonly toe_tip_offset_m: readonly number[];
  }[];
}

/** Requests fail with an Error whose message can be shown to the user. */
export class LibraryClient {
  /**
   * `base` is the beginning of URLs: "." for the server that served this page, or
   * "http://host:port".
   */
  constructor(private readonly base: string) {}

  libraries(): Promise<LibraryEntry[]> {
    return this.get('/libraries.json');
  }

  async skeleton(hash: string): Promise<SkeletonLike> {
    const it = await this.get<SkeletonJson>(`/libraries/${hash}/skeleton.json`);
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

  summary(hash: string): Promise<Summary> {
    return this.get(`/libraries/${hash}/summary.json`);
  }

  group(hash: string, group: number): Promise<Group> {
    return this.get(`/libraries/${hash}/${group}/sites.json`);
  }
  step(hash: string, group: number, p: readonly number[], corrected: boolean): Promise<Step> {
    return this.get(`/libraries/${hash}/${group}/step.json?p=${parametersText(p)}` +
      `&correction=${+corrected}`);
  }
  example(hash: string, group: number, index: number): Promise<Clip> {
    return this.get(`/libraries/${hash}/${group}/example.json?index=${index}`);
  }
  errors(
    hash: string, group: number, x: number, y: number, p: readonly number[], cells: number,
    corrected: boolean): Promise<ErrorMap> {
    return this.get(`/libraries/${hash}/${group}/errors.json?x=${x}&y=${y}&p=${parametersText(p)}` +
      `&cells=${cells}&correction=${+corrected}`);
  }

  private async get<T>(path: string): Promise<T> {
    let response: Response;
    try {
      response = await fetch(this.base + path);
    } catch {
      throw new Error('No server responds. Start stridewired, then reload this page.');
    }
    if (!response.ok) throw new Error((await response.text()).trim());
    return await response.json() as T;
  }
}

function parametersText(p: readonly number[]): string {
  return p.map((value) => value.toFixed(5)).join(',');
}

/**
 * Executes one request at a time. If several requests arrive in the meantime, it keeps only the
 * newest.
 */
export class LatestRequest<T> {
  private waiting: T | null = null;
  private busy = false;

  constructor(
    private readonly execute: (request: T) => Promise<void>,
    private readonly failed: (error: Error) => void) {}

  submit(request: T): void {
    this.waiting = request;
    if (!this.busy) void this.run();
  }

  private async run(): Promise<void> {
    this.busy = true;
    while (this.waiting !== null) {
      const request = this.waiting;
      this.waiting = null;
      try {
        await this.execute(request);
      } catch (error) {
        this.failed(error as Error);
      }
    }
    this.busy = false;
  }
}
