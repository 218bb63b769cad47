// The live connection: decodes messages, counts their age, connects again by itself.

const RETRY_MS = [500, 1000, 2000, 3000];
const HEARTBEAT_MS = 4000;

const ARRAYS = {
  "<u1": Uint8Array, "|u1": Uint8Array, u1: Uint8Array, uint8: Uint8Array,
  "<i4": Int32Array, i4: Int32Array, int32: Int32Array,
  "<u4": Uint32Array, u4: Uint32Array, uint32: Uint32Array,
  "<f4": Float32Array, f4: Float32Array, float32: Float32Array,
  "<f8": Float64Array, f8: Float64Array, float64: Float64Array,
};

/** Message of a websocket frame: length of the header (4 bytes, little-endian), header, payloads. */
export function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  let offset = 4 + length;
  for (const { name, dtype, shape } of header.arrays ?? []) {
    const Kind = ARRAYS[dtype];
    if (!Kind) throw new Error(`array ${name} of ${header.topic} has the unknown type ${dtype}`);
    const bytes = shape.reduce((a, b) => a * b, 1) * Kind.BYTES_PER_ELEMENT;
    // A copy: payloads are not aligned.
    arrays[name] = new Kind(buffer.slice(offset, offset + bytes));
    offset += bytes;
  }
  return { topic: header.topic, header, arrays };
}

/** Keeps a websocket open; calls `onMessage(message)` and `onState(open)`. */
export class Link {
  constructor(url, onMessage, onState) {
    this.url = url;
    this.onMessage = onMessage;
    this.onState = onState;
    this.failures = 0;
    this.heard = performance.now();
    this.connect();
    setInterval(() => this.watch(), 1000);
  }

  connect() {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heard = performance.now();
    socket.onopen = () => { this.failures = 0; this.onState(true); };
    socket.onmessage = (event) => { this.heard = performance.now(); this.receive(event.data); };
    socket.onclose = () => this.lost(socket);
  }

  receive(data) {
    try {
      this.onMessage(decode(data));
    } catch (error) {
      console.warn("a message was skipped:", error.message);
    }
  }

  lost(socket) {
    if (socket !== this.socket) return;
    this.socket = null;
    this.onState(false);
    const wait = RETRY_MS[Math.min(this.failures++, RETRY_MS.length - 1)];
    setTimeout(() => this.connect(), wait);
  }

  /** The bridge speaks every second; a half-open connection is given up. */
  watch() {
    const socket = this.socket;
    if (!socket || performance.now() - this.heard < HEARTBEAT_MS) return;
    socket.close();
    this.lost(socket);
  }
}

/** Ask the daemon; the answer is `{ok: true, ...}` or `{error: {code, message, hint}}`. */
export async function ask(request) {
  try {
    const response = await fetch("api/request", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(request),
    });
    return await response.json();
  } catch {
    return { error: { code: "unreachable", message: "The dashboard's server does not answer.", hint: "Is `lacuna dashboard` still running?" } };
  }
}
