import type {
  AvatarState, CurrentMovement, HeightFieldInfo, Hello, LibraryPiece, Movements, Observe,
  PoseBatch, RequestItem, SkeletonInfo, TerrainBoxInfo, Welcome, WorldInfo
} from '../../generated/messages';
import {maxRecordBytes, minResumeTokenBytes} from '../../generated/limits';
import type {ParameterName, Parameters} from '../types';
import {checkReducedJoints, checkRotationCodes} from './compact_codec';
import {compactPoseBytes, poseBytes} from './pose_codec';

export const parameterNames: readonly ParameterName[] = [
  'startX', 'startY', 'startZ', 'endX', 'endY', 'endZ', 'turn', 'length', 'height'
];

/** Throws Malformed for a field of the table that is being read. */
export type Fail = (what: string, field: string, index?: number) => never;

/** Converts a list of parameters to an object. */
export function parametersOf(list: readonly {readonly name: number; readonly value: number}[],
                             fail: (what: string) => never): Parameters {
  const values: {[name in ParameterName]?: number} = {};
  for (const {name: number, value} of list) {
    const name = parameterNames[number] ?? fail(`parameter ${number} is unknown`);
    if (name in values) fail(`${name} occurs twice`);
    values[name] = value;
  }
  return values;
}

/** The reverse of parametersOf. */
export function parameterList(parameters: Parameters): {name: number; value: number}[] {
  return Object.entries(parameters).map(
      ([name, value]) => ({name: parameterNames.indexOf(name as ParameterName), value}));
}

function checkToken({resumeToken}: {resumeToken: Uint8Array}, fail: Fail): void {
  if (resumeToken.length > 0 && resumeToken.length < minResumeTokenBytes) {
    fail('is not 16 to 64 bytes long', 'resumeToken');
  }
}

function checkPart({part, parts}: {part: number; parts: number}, fail: Fail): void {
  if (part >= parts) fail('is not below parts', 'part');
}

function checkOnePerAvatar(list: {length: number}, avatars: {length: number}, field: string,
                           fail: Fail): void {
  if (list.length !== avatars.length) fail('is not one per avatar', field);
}

/**
 * Rules of protocol/STANDARD.md that the attributes of the schema cannot express, per table. Their
 * arguments have passed all checks of single fields. A rule may also reset fields that are not
 * used.
 */
export const rules = {
  Hello(m: Hello, fail: Fail) {
    if (m.protocolMin > m.protocolMax) fail('is above protocolMax', 'protocolMin');
    checkToken(m, fail);
  },

  Welcome: checkToken,

  RequestItem(m: RequestItem, fail: Fail) {
    if (m.type === 'walk' && (m.atM === null || m.headingRad === null)) {
      fail('a walk requires atM and headingRad', 'atM');
    }
    // mustBeMet includes mustBeNear, and other types do not use it.
    if (m.exactOnly || (m.type !== 'step' && m.type !== 'jump')) m.allowNearest = false;
    if (m.atM === null) {
      m.headingRad = null;
    } else {
      m.lengthM = m.heightM = m.turnRad = 0;
      m.sideM = null;
    }
  },

  Observe(m: Observe, fail: Fail) {
    if (m.region === null && m.replace) fail('requires a region', 'replace');
    if (m.detail !== 'all' && m.mode !== 'quantised') fail('requires mode quantised', 'detail');
    if (m.region === null) return;
    if (m.avatars.length > 0) fail('must be empty beside a region', 'avatars');
    const {rings, ringDetails} = m.region;
    rings.forEach(({toM}, i) => {
      if (toM <= (rings[i - 1]?.toM ?? 0)) fail('does not increase', 'region.rings.toM', i);
    });
    if (ringDetails.length === 0) return;
    if (ringDetails.length !== rings.length) fail('is not one per ring', 'region.ringDetails');
    if (m.mode !== 'quantised') fail('requires mode quantised', 'region.ringDetails');
  },

  HeightField(m: HeightFieldInfo, fail: Fail) {
    if (m.heightsM.length !== m.columns * m.rows) fail('is not one per sample', 'heightsM');
  },

  TerrainBox(m: TerrainBoxInfo, fail: Fail) {
    if (!(m.minX < m.maxX && m.minZ < m.maxZ)) fail('max is not above min', '');
  },

  Skeleton({joints, endSites, leftLeg, rightLeg}: SkeletonInfo, fail: Fail) {
    const names = new Set<string>();
    joints.forEach(({name, parent}, j) => {
      if (names.has(name)) fail('occurs twice', 'joints.name', j);
      names.add(name);
      if (j === 0 ? parent !== -1 : parent < 0 || parent >= j) {
        fail('does not precede the joint', 'joints.parent', j);
      }
    });
    endSites.forEach(({joint}, e) => {
      if (joint >= joints.length) fail('is not a joint', 'endSites.joint', e);
    });
    for (const {hip, knee, ankle, ball} of [leftLeg, rightLeg]) {
      for (const joint of [hip, knee, ankle, ball]) {
        if (joint < -1 || joint >= joints.length) fail('is not a joint', 'leg');
      }
    }
  },

  WorldInfo(m: WorldInfo, fail: Fail) {
    const {joints} = m.skeleton;
    checkRotationCodes(m.rotationCodes, joints.length);
    if (m.reducedJoints.length > 0 && m.rotationCodes.length === 0) {
      fail('requires rotation codes', 'reducedJoints');
    }
    checkReducedJoints(m.reducedJoints, joints.map(({parent}) => parent));
  },

  PoseBatch(m: PoseBatch, fail: Fail) {
    checkPart(m, fail);
    checkOnePerAvatar(m.flags, m.avatars, 'flags', fail);
    const good = m.mode === 'movement' ? fail('is not a mode of poses', 'mode')
        : m.mode === 'full' || m.mode === 'quantised'
          ? m.poses.length === m.avatars.length * poseBytes(m.mode, m.jointCount)
          : compactPoseBytes(m.flags, m.poses.length, m.jointCount) >= 0;
    if (!good) fail('is not one per avatar', 'poses');
  },

  CurrentMovement(m: CurrentMovement, fail: Fail) {
    m.keytimesS.forEach((keytimeS, k) => {
      if (k === 0 ? keytimeS !== 0 : keytimeS < m.keytimesS[k - 1]!) {
        fail('is not ascending from 0', 'keytimesS', k);
      }
    });
    if (m.genericTime > Math.max(0, m.keytimesS.length - 1)) {
      fail('is after the last keytime', 'genericTime');
    }
    m.parameterNames.forEach((name, p) => {
      if (name >= parameterNames.length) fail(`parameter ${name} is unknown`, 'parameterNames', p);
      if (m.parameterNames.indexOf(name) !== p) fail('occurs twice', 'parameterNames', p);
    });
    if (!Number.isFinite(m.startTimeS + (m.keytimesS.at(-1) ?? 0))) {
      fail('is too large', 'keytimesS');
    }
    const sites = m.exampleParameters.length;
    if (sites !== 0 && sites !== m.weights.length * m.parameterNames.length) {
      fail('is not one row per weight', 'exampleParameters');
    }
  },

  AvatarState(m: AvatarState, fail: Fail) {
    if (m.queue.length > m.queueSize) fail('has more requests than queueSize', 'queue');
  },

  Movements(m: Movements, fail: Fail) {
    checkPart(m, fail);
    checkOnePerAvatar(m.flags, m.avatars, 'flags', fail);
    checkOnePerAvatar(m.ends, m.avatars, 'ends', fail);
    let before = 0;
    m.ends.forEach((end, i) => {
      if (end < before || end - before > maxRecordBytes) {
        fail('is descending, or the record is too long', 'ends', i);
      }
      before = end;
    });
    if (before !== m.records.length) fail('does not end with the last record', 'records');
  },

  LibraryPiece(m: LibraryPiece, fail: Fail) {
    if (m.offset + m.bytes.length > m.totalBytes) fail('is not inside the library', 'bytes');
  },
};
