import {PoseFlag} from './types';
import type {BatchMode} from './wire/messages';

const detailFlags = PoseFlag.fewerJoints | PoseFlag.rootOnly;

/** What is true of an avatar until something else is told, unlike a discontinuity. */
export const lastingFlags = PoseFlag.standing | detailFlags;

/** What a pose's flags say of it: `sent` in a batch of that mode. */
export function flagsOf(sent: number, mode: BatchMode): number {
  const detail = mode === 'compactFewer' ? PoseFlag.fewerJoints :
    mode === 'compactRoot' ? PoseFlag.rootOnly : 0;
  return (sent & (PoseFlag.discontinuity | PoseFlag.standing)) | detail;
}
