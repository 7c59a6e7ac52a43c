// Ids of this page's movement requests. They start at a random number, so that two pages that
// command the same avatar do not confuse their requests.

let next = (BigInt(Math.floor(Math.random() * 2 ** 40)) << 20n) + (1n << 62n);

export function nextRequestId(): bigint {
  return next++;
}
