// Reads metrics in Prometheus' text format.

/**
 * Values by metric name. Samples with different labels are summed, because the page shows totals of
 * all shards. Histogram buckets and values that are not finite are skipped.
 */
export function parseMetrics(text: string): Map<string, number> {
  const values = new Map<string, number>();
  for (const line of text.split('\n')) {
    if (line === '' || line[0] === '#') continue;
    const match = /^([a-zA-Z_:][a-zA-Z0-9_:]*)(\{[^}]*\})?\s+(\S+)/.exec(line);
    if (!match || match[2]?.includes('le="')) continue;
    const value = Number(match[3]);
    if (Number.isFinite(value)) values.set(match[1]!, (values.get(match[1]!) ?? 0) + value);
  }
  return values;
}

/**
 * Mean of the observations that a histogram counted between two scrapes; null if there are none.
 */
export function meanSince(
  now: ReadonlyMap<string, number>, before: ReadonlyMap<string, number>,
  name: string): number | null {
  const count = (now.get(`${name}_count`) ?? 0) - (before.get(`${name}_count`) ?? 0);
  const sum = (now.get(`${name}_sum`) ?? 0) - (before.get(`${name}_sum`) ?? 0);
  return count > 0 && sum >= 0 ? sum / count : null;
}
