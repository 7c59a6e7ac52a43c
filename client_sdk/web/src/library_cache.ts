import type {LibraryCache} from './client_types';

const maxLibraries = 16;
const maxBytes = 64 * 2 ** 20;

/** Properties of a stored library. */
interface Use {
  readonly hash: string;
  readonly bytes: number;
  readonly usedMs: number;
}

/** Keeps libraries in the IndexedDB of the page's origin. */
class IndexedDbCache implements LibraryCache {
  private opened: Promise<IDBDatabase> | null = null;

  constructor(private readonly factory: IDBFactory) {}

  async load(hash: string): Promise<Uint8Array | null> {
    let file: unknown = null;
    await this.transact((files, uses) => {
      files.get(hash).onsuccess = ({target}) => {
        file = (target as IDBRequest).result;
        if (file instanceof Uint8Array) uses.put(useOf(hash, file));
      };
    });
    return file instanceof Uint8Array ? file : null;
  }

  async store(hash: string, file: Uint8Array): Promise<void> {
    if (file.length > maxBytes) return;
    await this.transact((files, uses) => {
      files.put(file, hash);
      uses.put(useOf(hash, file));
      uses.getAll().onsuccess = ({target}) => {
        const newestFirst =
            (target as IDBRequest<Use[]>).result.sort((a, b) => b.usedMs - a.usedMs);
        let total = 0;
        newestFirst.forEach((use, i) => {
          total += use.bytes;
          if (use.hash === hash || (i < maxLibraries && total <= maxBytes)) return;
          files.delete(use.hash);
          uses.delete(use.hash);
        });
      };
    });
  }

  /** Runs a transaction on both stores. Rejects if it fails, for example for lack of disk space. */
  private async transact(
      work: (files: IDBObjectStore, uses: IDBObjectStore) => void): Promise<void> {
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
        // The user may delete the data, and a newer version of the page may change the stores.
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

function useOf(hash: string, file: Uint8Array): Use {
  return {hash, bytes: file.length, usedMs: Date.now()};
}

let shared: LibraryCache | null = null;

/** Returns the cache of this page; null where IndexedDB is missing or not allowed. */
export function defaultLibraryCache(): LibraryCache | null {
  try {
    if (typeof indexedDB === 'object') shared ??= new IndexedDbCache(indexedDB);
  } catch {
    // Pages with an opaque origin must not access IndexedDB.
  }
  return shared;
}
