import {statusName, statusText} from './status';

/** Reason why `World.inspect` failed. */
export class StridewireError extends Error {
  /** Name of `code`, for example `no_such_avatar`. */
  readonly status: string;

  /** `code` is one of `Status`. If `text` is empty, the message is the text of the code. */
  constructor(readonly code: number, text: string) {
    super(text || statusText(code));
    this.name = 'StridewireError';
    this.status = statusName(code);
  }
}
