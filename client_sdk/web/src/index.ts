/** Stridewire in a browser: spawn figures, command them, show their poses. */
export * from './types';
export {Status, statusName, statusText} from './status';
