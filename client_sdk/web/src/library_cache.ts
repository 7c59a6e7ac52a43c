import type {LibraryCache} from './client_types';

const maxLibraries = 16;
const maxBytes = 64 * 2 ** 20;

/** Properties of a stored library, in the object store `uses`. */
interface CacheEntry {
  readonly hash: string;
  readonly bytes: number;
  /** Time at which the library was last loaded or stored, in milliseconds since 1970. */
  readonly usedMs: number;
}

/** Keeps libraries in the IndexedDB of the page's origin. */
class IndexedDbCache implements LibraryCache {
  private opened: Promise<IDBDatabase> | null = null;

  constructor(private readonly factory: IDBFactory) {}

  async load(hash: string): Promise<Uint8Array | null> {
    let file: unknown = null;
    await this.transact((files, entries) => {
      files.get(hash).onsuccess = ({target}) => {
        file = (target as IDBRequest).result;
        if (file instanceof Uint8Array) entries.put(makeEntry(hash, file));
      };
    });
    return file instanceof Uint8Array ? file : null;
  }

  /**
   * Stores a library. If the cache then exceeds its limits, removes the least recently used
   * libraries. Does not store files of more than 64 MiB.
   */
  async store(hash: string, file: Uint8Array): Promise<void> {
    if (file.length > maxBytes) return;
    await this.transact((files, entries) => {
      files.put(file, hash);
      entries.put(makeEntry(hash, file));
      entries.getAll().onsuccess = ({target}) => {
        const newestFirst =
            (target as IDBRequest<CacheEntry[]>).result.sort((a, b) => b.usedMs - a.usedMs);
        let total = 0;
        newestFirst.forEach((entry, i) => {
          total += entry.bytes;
          if (entry.hash === hash || (i < maxLibraries && total <= maxBytes)) return;
          files.delete(entry.hash);
          entries.delete(entry.hash);
        });
      };
    });
  }

  /**
   * Runs a transaction on both object stores. Rejects if it fails, for example because the disk is
   * full.
   */
  private async transact(
      work: (files: IDBObjectStore, entries: IDBObjectStore) => void): Promise<void> {
    const database = await (this.opened ??= this.open());
    await new Promise<void>((resolve, reject) => {
      const transaction = database.transaction(['files', 'uses'], 'readwrite');
      transaction.oncomplete = () => resolve();
      transaction.onabort = () => reject(transaction.error);
      work(transaction.objectStore('files'), transaction.objectStore('uses'));
    });
  }

  private open(): Promise<IDBDatabase> {
    return new Promise((resolve, reject) => {
      const request = this.factory.open('stridewire-libraries', 1);
      request.onupgradeneeded = () => {
        request.result.createObjectStore('files');
        request.result.createObjectStore('uses', {keyPath: 'hash'});
      };
      request.onsuccess = () => {
        const database = request.result;
        // Closes the connection when the user deletes the data, or when a newer version of the page
        // must change the object stores. The next transaction opens the database again.
        database.onclose = database.onversionchange = () => {
          database.close();
          this.opened = null;
        };
        resolve(database);
      };
      request.onerror = () => {
        this.opened = null;
        reject(request.error);
      };
    });
  }
}

function makeEntry(hash: string, file: Uint8Array): CacheEntry {
  return {hash, bytes: file.length, usedMs: Date.now()};
}

let shared: LibraryCache | null = null;

/** Returns the cache that all clients of this page share; null if the page cannot use IndexedDB. */
export function defaultLibraryCache(): LibraryCache | null {
  try {
    if (typeof indexedDB === 'object') shared ??= new IndexedDbCache(indexedDB);
  } catch {
    // In pages with an opaque origin, for example sandboxed frames, reading `indexedDB` throws.
  }
  return shared;
}
