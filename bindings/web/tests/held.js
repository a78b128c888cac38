// The worker of a session, which holds a lock as long as it lives. The lock has the name of the script's query.
import "/package/session-worker.js";

navigator.locks.request(location.search, () => new Promise(() => {}));
