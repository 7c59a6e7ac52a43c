// Finds the joints of a skeleton that form trunk, head, arms and legs, so that a body can be built
// for any skeleton. Uses the rest pose, in which all skeletons face +Z with +Y up and all rotations
// are the identity, and the legs that the server reports. Joint names are used only to find the
// head.

/** Joint indices of a leg, -1 if unknown; offsets in metres in the frame of the ball's joint. */
export interface LegLike {
  readonly hip: number;
  readonly knee: number;
  readonly ankle: number;
  readonly ball: number;
  readonly ballOffsetM: ArrayLike<number>;
  readonly toeTipOffsetM: ArrayLike<number>;
}
/** The parts of `Skeleton` of `@stridewire/client` that the viewer uses. Offsets are in metres. */
export interface SkeletonLike {
  readonly jointCount: number;
  readonly names: readonly string[];
  readonly parents: ArrayLike<number>;
  readonly offsetsM: ArrayLike<number>;
  readonly endSites: readonly {readonly joint: number; readonly offsetM: ArrayLike<number>}[];
  readonly leftLeg: LegLike;
  readonly rightLeg: LegLike;
}

/** A point or direction in metres. */
export type Vec = [number, number, number];

/** A point of the rest pose, and the joint that it moves with. */
export interface Anchor {
  readonly joint: number;
  readonly at: Vec;
}
export interface ArmParts {
  /** +1 for the left arm, which is on the side of +X; -1 for the right arm. */
  readonly side: number;
  readonly shoulder: Anchor;
  readonly elbow: Anchor;
  readonly wrist: Anchor;
  /** The point of the hand that is farthest from the wrist. */
  readonly tip: Vec;
}
export interface LegParts {
  readonly hip: Anchor;
  readonly knee: Anchor;
  readonly ankle: Anchor;
  readonly ball: Anchor;
  /** Position of the tip of the toes. */
  readonly toe: Vec;
}
export interface BodyParts {
  /** Joint positions in the rest pose, 3 numbers per joint; the root is at the origin. */
  readonly rest: Float32Array;
  /** Indices of the children of each joint. */
  readonly children: readonly (readonly number[])[];
  /** Height of the lowest point. */
  readonly groundY: number;
  readonly heightM: number;
  /** Anchors from the root to the head's joint, each higher than the one before. */
  readonly trunk: readonly Anchor[];
  readonly head: Anchor;
  /** Height of the top of the head, in metres. */
  readonly crownY: number;
  readonly arms: readonly ArmParts[];
  readonly legs: readonly LegParts[];
  /** Joints of none of these parts, for example tails, ears or props. */
  readonly otherJoints: readonly number[];
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
/** Returns `fallback` if `a` has almost no length. */
export function normalised(a: Vec, fallback: Vec): Vec {
  const l = length(a);
  return l > 1e-9 ? [a[0] / l, a[1] / l, a[2] / l] : fallback;
}
export function mix(a: Vec, b: Vec, t: number): Vec {
  return [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t];
}

/** Joint positions in the rest pose, 3 numbers per joint; the root is at the origin. */
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

/**
 * Skeletons may lack parts: the result may have no arms, no legs, or a trunk of only one anchor.
 */
export function findBodyParts(skeleton: SkeletonLike): BodyParts {
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
  const markUsed = (j: number): void => {
    used[j] = 1;
    for (const child of children[j]!) markUsed(child);
  };

  // The server reports which joints form the legs.
  const legs: LegParts[] = [];
  for (const leg of [skeleton.leftLeg, skeleton.rightLeg]) {
    if (!leg || leg.hip < 0 || leg.knee < 0 || leg.ankle < 0) continue;
    const ball = leg.ball >= 0 ? leg.ball : leg.ankle;
    const ballAt = add(at(ball), vec(leg.ballOffsetM));
    const toe = add(at(ball), vec(leg.toeTipOffsetM));
    legs.push({
      hip: {joint: leg.hip, at: at(leg.hip)},
      knee: {joint: leg.knee, at: at(leg.knee)},
      ankle: {joint: leg.ankle, at: at(leg.ankle)},
      ball: {joint: ball, at: ballAt},
      toe: length(subtract(toe, ballAt)) > 1e-4 ? toe : add(ballAt, [0, 0, 0.06]),
    });
    markUsed(leg.hip);
    // Some skeletons have a joint between root and hip that has no other children.
    let above = skeleton.parents[leg.hip]!;
    for (; above > 0 && children[above]!.length === 1; above = skeleton.parents[above]!) {
      used[above] = 1;
    }
  }

  // The height is the distance between the lowest and the highest point.
  let low = Infinity;
  let high = -Infinity;
  const extendHeight = (p: Vec): void => {
    low = Math.min(low, p[1]);
    high = Math.max(high, p[1]);
  };
  for (let j = 0; j < count; ++j) {
    extendHeight(at(j));
    tips[j]!.forEach(extendHeight);
  }
  for (const leg of legs) extendHeight(leg.toe);
  const heightM = Math.max(high - low, 0.2);

  // The head is the first joint whose name ends in "head", or else the joint with the highest
  // point.
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
  const raiseCrown = (j: number): void => {
    for (const tip of tips[j]!) crownY = Math.max(crownY, tip[1]);
    for (const child of children[j]!) {
      crownY = Math.max(crownY, at(child)[1]);
      raiseCrown(child);
    }
  };
  raiseCrown(head);
  crownY = Math.min(crownY, at(head)[1] + 0.16 * heightM);

  // The trunk consists of the joints from the root to the head, with one anchor per height.
  const rootToHead: number[] = [];
  for (let j = head; j >= 0; j = skeleton.parents[j]!) {
    rootToHead.unshift(j);
    used[j] = 1;
    if (j === 0) break;
  }
  const trunk: Anchor[] = [];
  for (const j of rootToHead) {
    const last = trunk[trunk.length - 1];
    if (last && at(j)[1] - last.at[1] < 0.004 * heightM) {
      if (j === head && trunk.length > 1) trunk.pop();
      else if (j !== head) {
        // Of two joints at the same height, the second moves the part above them.
        trunk[trunk.length - 1] = {joint: j, at: last.at};
        continue;
      }
    }
    trunk.push({joint: j, at: at(j)});
  }

  // Arms are the long branches of the trunk.
  const arms: ArmParts[] = [];
  for (const from of rootToHead) {
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
        // Of pairs of similar length, the last one consists of upper arm and forearm. A collar bone
        // comes before them, and fingers are much shorter.
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
      const extendTip = (j: number): void => {
        for (const p of [at(j), ...tips[j]!]) {
          if (length(subtract(p, wrist)) > length(subtract(tip, wrist))) tip = p;
        }
        children[j]!.forEach(extendTip);
      };
      extendTip(fore.to);
      arms.push({
        side: wrist[0] >= 0 ? 1 : -1,
        shoulder: {joint: upper.joint, at: at(upper.joint)},
        elbow: {joint: fore.joint, at: at(fore.joint)},
        wrist: {joint: fore.to, at: wrist},
        tip,
      });
      markUsed(branch);
    }
  }

  const otherJoints: number[] = [];
  for (let j = 1; j < count; ++j) if (!used[j]) otherJoints.push(j);
  return {
    rest, children, groundY: low, heightM, trunk, head: {joint: head, at: at(head)}, crownY, arms,
    legs, otherJoints,
  };
}

function vec(a: ArrayLike<number>): Vec {
  return [a[0] ?? 0, a[1] ?? 0, a[2] ?? 0];
}

/** Returns the longest chain of unused joints that starts at `from`, by the sum of bone lengths. */
function longestChain(
  from: number, children: readonly (readonly number[])[], at: (j: number) => Vec,
  used: Uint8Array): number[] {
  let best: number[] = [];
  let bestLength = -1;
  for (const child of children[from]!) {
    if (used[child]) continue;
    const chain = longestChain(child, children, at, used);
    let l = length(subtract(at(child), at(from)));
    for (let i = 0; i + 1 < chain.length; ++i) {
      l += length(subtract(at(chain[i + 1]!), at(chain[i]!)));
    }
    if (l > bestLength) {
      bestLength = l;
      best = chain;
    }
  }
  return [from, ...best];
}
