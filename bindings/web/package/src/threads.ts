import { PhasefrontError } from "./error.js";

// The module with threads has another file in this place.

/** Returns the number of threads to start: 1. */
export function threadsToStart(asked: number | undefined): number {
  if (asked === undefined || asked === 1) return 1;
  const why = `${asked} threads are asked for, and this module has one; import from phasefront/threads`;
  throw new PhasefrontError("session", why);
}

/** Starts nothing: the calling thread computes. */
export async function start(_threads: number): Promise<void> {}
