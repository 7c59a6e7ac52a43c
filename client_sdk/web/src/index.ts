/** Stridewire in a browser: spawn figures, command them, show their poses. */
export * from './types';
export {Client} from './client';
export {StridewireError} from './error';
export {Status, statusName, statusText} from './status';
export {createCrowdPose, createPose} from './room';
