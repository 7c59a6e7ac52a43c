// What a skeleton's joints are for: which carry the trunk, the head, the arms, the legs. Found from
// the rest pose (every figure of Stridewire faces +Z with +Y up at identity rotations) and the legs
// the server names, so that any skeleton becomes a body; names only help to find the head.

/** A skeleton as `@stridewire/client` describes it; metres. */
export interface LegLike {
  readonly hip: number;
  readonly knee: number;
  readonly ankle: number;
  readonly ball: number;
  readonly ballOffsetM: ArrayLike<number>;
  readonly toeTipOffsetM: ArrayLike<number>;
}
export interface SkeletonLike {
  readonly jointCount: number;
  readonly names: readonly string[];
  readonly parents: ArrayLike<number>;
  readonly offsetsM: ArrayLike<number>;
  readonly endSites: readonly {readonly joint: number; readonly offsetM: ArrayLike<number>}[];
  readonly leftLeg: LegLike;
  readonly rightLeg: LegLike;
}

export type Vec = [number, number, number];

/** A point of the rest pose and the joint that carries it. */
export interface Anchor {
  readonly joint: number;
  readonly at: Vec;
}
export interface Arm {
  readonly side: number;  // +1: the figure's left (+X)
  readonly shoulder: Anchor;
  readonly elbow: Anchor;
  readonly wrist: Anchor;
  readonly tip: Vec;
}
export interface LegFigure {
  readonly side: number;
  readonly hip: Anchor;
  readonly knee: Anchor;
  readonly ankle: Anchor;
  readonly ball: Anchor;
  readonly toe: Vec;
}
export interface Figure {
  readonly rest: Float32Array;  // 3 a joint: where it is at identity rotations, root at the origin
  readonly children: readonly (readonly number[])[];
  readonly groundY: number;
  readonly heightM: number;
  readonly trunk: readonly Anchor[];  // from the root to the head's joint, rising
  readonly head: Anchor;
  readonly crownY: number;
  readonly arms: readonly Arm[];
  readonly legs: readonly LegFigure[];
  readonly others: readonly number[];  // joints of no limb above: tails, ears, props, fingers
}

export function subtract(a: Vec, b: Vec): Vec {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}
export function add(a: Vec, b: Vec, scale = 1): Vec {
  return [a[0] + b[0] * scale, a[1] + b[1] * scale, a[2] + b[2] * scale];
}
export function length(a: Vec): number {
  return Math.hypot(a[0], a[1], a[2]);
}
export function normalised(a: Vec, otherwise: Vec): Vec {
  const l = length(a);
  return l > 1e-9 ? [a[0] / l, a[1] / l, a[2] / l] : otherwise;
}
export function mix(a: Vec, b: Vec, t: number): Vec {
  return [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t];
}

/** Positions of the joints at identity rotations, the root at the origin. */
export function restPositions(skeleton: SkeletonLike): Float32Array {
  const rest = new Float32Array(skeleton.jointCount * 3);
  for (let j = 1; j < skeleton.jointCount; ++j) {
    const parent = skeleton.parents[j]!;
    for (let k = 0; k < 3; ++k) {
      rest[j * 3 + k] = (parent >= 0 ? rest[parent * 3 + k]! : 0) + skeleton.offsetsM[j * 3 + k]!;
    }
  }
  return rest;
}

export function figureOf(skeleton: SkeletonLike): Figure {
  const count = skeleton.jointCount;
  const rest = restPositions(skeleton);
  const at = (j: number): Vec => [rest[j * 3]!, rest[j * 3 + 1]!, rest[j * 3 + 2]!];
  const children: number[][] = Array.from({length: count}, () => []);
  for (let j = 1; j < count; ++j) {
    const parent = skeleton.parents[j]!;
    if (parent >= 0 && parent < j) children[parent]!.push(j);
  }
  const tips: Vec[][] = Array.from({length: count}, () => []);
  for (const site of skeleton.endSites) {
    if (site.joint < count) tips[site.joint]!.push(add(at(site.joint), vec(site.offsetM)));
  }

  const used = new Uint8Array(count);
  const mark = (j: number): void => {
    used[j] = 1;
    for (const child of children[j]!) mark(child);
  };

  // Legs, as the server names them.
  const legs: LegFigure[] = [];
  for (const [side, leg] of [[1, skeleton.leftLeg], [-1, skeleton.rightLeg]] as const) {
    if (!leg || leg.hip < 0 || leg.knee < 0 || leg.ankle < 0) continue;
    const ball = leg.ball >= 0 ? leg.ball : leg.ankle;
    const ballAt = add(at(ball), vec(leg.ballOffsetM));
    const toe = add(at(ball), vec(leg.toeTipOffsetM));
    legs.push({
      side,
      hip: {joint: leg.hip, at: at(leg.hip)},
      knee: {joint: leg.knee, at: at(leg.knee)},
      ankle: {joint: leg.ankle, at: at(leg.ankle)},
      ball: {joint: ball, at: ballAt},
      toe: length(subtract(toe, ballAt)) > 1e-4 ? toe : add(ballAt, [0, 0, 0.06]),
    });
    mark(leg.hip);
    // Some figures have a joint between root and hip that only leads there.
    for (let j = skeleton.parents[leg.hip]!; j > 0 && children[j]!.length === 1; j = skeleton.parents[j]!) {
      used[j] = 1;
    }
  }

  // The ground is where the lowest point stands; the height reaches to the highest.
  let low = Infinity;
  let high = -Infinity;
  const reach = (p: Vec): void => {
    low = Math.min(low, p[1]);
    high = Math.max(high, p[1]);
  };
  for (let j = 0; j < count; ++j) {
    reach(at(j));
    tips[j]!.forEach(reach);
  }
  for (const leg of legs) reach(leg.toe);
  const heightM = Math.max(high - low, 0.2);

  // The head: a joint of that name, else the one that carries the highest point.
  let head = -1;
  let crownY = -Infinity;
  for (let j = 0; j < count; ++j) {
    if (/head$/i.test(skeleton.names[j] ?? '') && !used[j]) {
      head = j;
      break;
    }
  }
  if (head < 0) {
    for (let j = 0; j < count; ++j) {
      if (used[j]) continue;
      for (const tip of [at(j), ...tips[j]!]) {
        if (tip[1] > crownY + 1e-6) {
          crownY = tip[1];
          head = j;
        }
      }
    }
  }
  if (head < 0) head = 0;
  crownY = at(head)[1] + 0.1 * heightM;
  const climb = (j: number): void => {
    for (const tip of tips[j]!) crownY = Math.max(crownY, tip[1]);
    for (const child of children[j]!) {
      crownY = Math.max(crownY, at(child)[1]);
      climb(child);
    }
  };
  climb(head);
  crownY = Math.min(crownY, at(head)[1] + 0.16 * heightM);

  // The trunk: the way from the root to the head, one anchor a height.
  const way: number[] = [];
  for (let j = head; j >= 0; j = skeleton.parents[j]!) {
    way.unshift(j);
    used[j] = 1;
    if (j === 0) break;
  }
  const trunk: Anchor[] = [];
  for (const j of way) {
    const last = trunk[trunk.length - 1];
    if (last && at(j)[1] - last.at[1] < 0.004 * heightM) {
      if (j === head && trunk.length > 1) trunk.pop();
      else if (j !== head) {
        // Two joints at one height: what lies above turns with the second.
        trunk[trunk.length - 1] = {joint: j, at: last.at};
        continue;
      }
    }
    trunk.push({joint: j, at: at(j)});
  }

  // Arms: what branches from the trunk and is long.
  const arms: Arm[] = [];
  for (const from of way) {
    for (const branch of children[from]!) {
      if (used[branch]) continue;
      const chain = longestChain(branch, children, at, used);
      const segments: {joint: number; to: number; length: number}[] = [];
      for (let i = 0; i + 1 < chain.length; ++i) {
        const l = length(subtract(at(chain[i + 1]!), at(chain[i]!)));
        if (l > 0.02 * heightM) segments.push({joint: chain[i]!, to: chain[i + 1]!, length: l});
      }
      let best = -1;
      let bestLength = 0;
      for (let i = 0; i + 1 < segments.length; ++i) {
        const l = segments[i]!.length + segments[i + 1]!.length;
        // Of two as long the later: a collar bone comes before an arm, fingers are much shorter.
        if (l > bestLength * 0.8) {
          bestLength = Math.max(l, bestLength);
          best = i;
        }
      }
      if (best < 0 || bestLength < 0.18 * heightM || arms.length >= 2) continue;
      const upper = segments[best]!;
      const fore = segments[best + 1]!;
      const wrist = at(fore.to);
      let tip = wrist;
      const seek = (j: number): void => {
        for (const p of [at(j), ...tips[j]!]) {
          if (length(subtract(p, wrist)) > length(subtract(tip, wrist))) tip = p;
        }
        children[j]!.forEach(seek);
      };
      seek(fore.to);
      arms.push({
        side: wrist[0] >= 0 ? 1 : -1,
        shoulder: {joint: upper.joint, at: at(upper.joint)},
        elbow: {joint: fore.joint, at: at(fore.joint)},
        wrist: {joint: fore.to, at: wrist},
        tip,
      });
      mark(branch);
    }
  }

  const others: number[] = [];
  for (let j = 1; j < count; ++j) if (!used[j]) others.push(j);
  return {
    rest, children, groundY: low, heightM, trunk, head: {joint: head, at: at(head)}, crownY, arms,
    legs, others,
  };
}

function vec(a: ArrayLike<number>): Vec {
  return [a[0] ?? 0, a[1] ?? 0, a[2] ?? 0];
}

/** The chain of joints from `from` whose way is the longest. */
function longestChain(
  from: number, children: readonly (readonly number[])[], at: (j: number) => Vec,
  used: Uint8Array): number[] {
  let best: number[] = [];
  let bestLength = -1;
  for (const child of children[from]!) {
    if (used[child]) continue;
    const chain = longestChain(child, children, at, used);
    let l = length(subtract(at(child), at(from)));
    for (let i = 0; i + 1 < chain.length; ++i) l += length(subtract(at(chain[i + 1]!), at(chain[i]!)));
    if (l > bestLength) {
      bestLength = l;
      best = chain;
    }
  }
  return [from, ...best];
}
