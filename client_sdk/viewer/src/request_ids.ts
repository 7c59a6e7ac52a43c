// Ids of this page's movement requests. They start at a random number. Two pages that command the
// same avatar can thus distinguish their requests.

let next = (BigInt(Math.floor(Math.random() * 2 ** 40)) << 20n) + (1n << 62n);

export function nextRequestId(): bigint {
  return next++;
}
