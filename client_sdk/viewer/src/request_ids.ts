// Numbers of this page's own requests. Pages that command the same avatar do not take each other's for theirs.

let next = (BigInt(Math.floor(Math.random() * 2 ** 40)) << 20n) + (1n << 62n);

export function nextRequestId(): bigint {
  return next++;
}
