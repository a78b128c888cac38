/** Whether this folder has the module with threads; the build script changes it there. */
export const THREADED: boolean = false;
