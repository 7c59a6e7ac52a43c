import {statusName, statusText} from './status';

/** Why a question was not answered. */
export class StridewireError extends Error {
  readonly status: string;
  constructor(readonly code: number, text: string) {
    super(text || statusText(code));
    this.name = 'StridewireError';
    this.status = statusName(code);
  }
}
