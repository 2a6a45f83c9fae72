// The page's interface to the worker: requests as promises, and pushed frames.

export class Engine {
  #worker = null;
  #asked = new Map();
  #next = 0;
  #given = {};

  /** Calls `frames({ frames, ended })`, `progress(share)` and `failed(line)` for what comes unasked. */
  constructor({ frames, progress, failed }) {
    this.on = { frames, progress, failed };
    this.#begin();
  }

  #begin() {
    this.#given = {};
    // From a blob, so that the page's content security policy also binds the worker: a file would have its own policy, or none.
    const source = `import ${JSON.stringify(new URL("./worker.js", import.meta.url).href)};`;
    const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    this.#worker = new Worker(url, { type: "module" });
    this.#worker.onmessage = ({ data }) => this.#hear(data);
    this.#worker.onerror = (event) => {
      event.preventDefault();
      const line = `the page's worker cannot run: ${event.message ?? "its file could not be loaded"}`;
      for (const { refuse } of this.#asked.values()) refuse(new Error(line));
      this.#asked.clear();
      this.on.failed(line);
    };
    this.ready = this.ask("ready").finally(() => URL.revokeObjectURL(url));
    this.ready.catch(() => {});
  }

  #hear(data) {
    if (data.id === undefined) {
      if (data.error) this.on.failed(data.error, data.fault);
      else if (data.frames) this.on.frames(data);
      else this.on.progress(data.progress);
      return;
    }
    const asked = this.#asked.get(data.id);
    this.#asked.delete(data.id);
    if (!asked) return;
    if (data.error === undefined) asked.answer(data.ok);
    else asked.refuse(Object.assign(new Error(data.error), { fault: data.fault }));
  }

  /** The answer to a request. */
  ask(ask, request = {}) {
    const id = this.#next++;
    return new Promise((answer, refuse) => {
      this.#asked.set(id, { answer, refuse });
      this.#worker.postMessage({ id, ask, ...request });
    });
  }

  /** Gives the worker a mesh or a picture, unless it has it already; gives what it said of it. */
  async give(kind, request) {
    const key = request.blob ?? request;
    if (this.#given[kind]?.key !== key) {
      delete this.#given[kind];
      const answer = await this.ask(kind, request);
      this.#given[kind] = { key, answer };
    }
    return this.#given[kind].answer;
  }

  /** Ends whatever the worker does, and begins anew: it knows no mesh, picture or run then. */
  renew() {
    this.#worker.terminate();
    for (const { refuse } of this.#asked.values()) refuse(new Ended());
    this.#asked.clear();
    this.#begin();
  }
}

/** What a request gets whose worker was ended: nothing that a reader has to be told. */
export class Ended extends Error {}
