/** The kind of an error, which an app can act on. */
export type ErrorKind = "display" | "frame" | "timestamp" | "setting" | "network" | "session" | "internal";

/** An error of Phasefront. The message is one line that names the fault and the correct value. */
export class PhasefrontError extends Error {
  override readonly name = "PhasefrontError";

  constructor(
    /** The kind of the error. `internal` is a fault of Phasefront; please report it. */
    readonly kind: ErrorKind,
    message: string,
  ) {
    super(message);
  }
}

let state: "not loaded" | "ready" | PhasefrontError = "not loaded";

/** Records that the module is loaded. */
export function ready(): void {
  state = "ready";
}

/**
 * Returns the result of a `call` of the module. A module that panicked is not called again, because its memory may be
 * half written.
 */
export function guard<T>(call: () => T): T {
  if (state === "not loaded") throw new PhasefrontError("session", "the module is not loaded; await load() first");
  if (state !== "ready") throw state;
  try {
    return call();
  } catch (error) {
    throw ofModule(error);
  }
}

/** Does as {@link guard} does for a `call` whose result comes later. */
export async function guardAsync<T>(call: () => Promise<T>): Promise<T> {
  // A panic after a pause ends no promise; the browser reports it to the page or the worker.
  let panicked: (event: ErrorEvent) => void = () => {};
  const panic = new Promise<never>((_, reject) => {
    panicked = (event) => {
      const said = ofModule(event.error);
      if (said !== state) return;
      // The promise tells it. The page that owns a worker would hear of it first by the worker's event.
      event.preventDefault();
      reject(said);
    };
  });
  // Node has no such events.
  globalThis.addEventListener?.("error", panicked);
  try {
    return await Promise.race([guard(call).catch((error: unknown) => Promise.reject(ofModule(error))), panic]);
  } finally {
    globalThis.removeEventListener?.("error", panicked);
  }
}

/** Converts an error that the module threw. */
function ofModule(error: unknown): unknown {
  if (!(error instanceof Error) || error instanceof PhasefrontError) return error;
  const kind = (error as { kind?: string }).kind;
  if (kind === "panic" || error instanceof WebAssembly.RuntimeError || error instanceof RangeError) {
    const line = error.message.replaceAll("\n", " ");
    state = new PhasefrontError(
      "internal",
      `internal error: ${line}; the module cannot go on: load the page or the worker anew, and please report it`,
    );
    return state;
  }
  return kind === undefined ? error : new PhasefrontError(kind as ErrorKind, error.message);
}

/** Frees an object of the module. After a panic nothing can be freed. */
export function release(raw: { free(): void } | undefined): void {
  if (state === "ready") raw?.free();
}

/** Returns `value`, which must be an integer that fits the module's 32 bits. */
export function whole(what: string, value: number, kind: ErrorKind = "setting"): number {
  if (Number.isInteger(value) && value >= 0 && value < 2 ** 32) return value;
  throw new PhasefrontError(kind, `${what} is ${value}; a whole number from 0 to ${2 ** 32 - 1} is right`);
}

/** Returns the bytes of any array without copying. */
export function bytesOf(what: string, data: unknown, kind: ErrorKind): Uint8Array {
  if (ArrayBuffer.isView(data)) return new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  if (data instanceof ArrayBuffer) return new Uint8Array(data);
  throw new PhasefrontError(kind, `${what} is ${typeof data}; a typed array or an ArrayBuffer is right`);
}
