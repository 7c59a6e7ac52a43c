/** Lists of listeners, by event name. An exception in a listener is reported as uncaught. It
 * affects neither other listeners nor the caller of `emit`. */
export class Listeners<L extends {[K in keyof L]: (...args: never[]) => void}> {
  private readonly lists = new Map<keyof L, Set<L[keyof L]>>();

  /** Adds a listener and returns a function that removes it. */
  on<K extends keyof L>(name: K, listener: L[K]): () => void {
    const list = this.lists.get(name) ?? new Set();
    this.lists.set(name, list.add(listener));
    return () => void list.delete(listener);
  }

  has(name: keyof L): boolean {
    return (this.lists.get(name)?.size ?? 0) > 0;
  }

  emit<K extends keyof L>(name: K, ...args: Parameters<L[K]>): void {
    for (const listener of this.lists.get(name) ?? []) {
      try {
        listener(...args);
      } catch (error) {
        queueMicrotask(() => {
          throw error;
        });
      }
    }
  }
}
