// Blobs of page_blobs.py: base64 of a deflated JSON line and bytes, decoded when they are first wanted.

const decoded = new Map();

// {head, bytes} of a blob; null if the page has none of that name.
export function readBlob(name) {
  if (!decoded.has(name)) {
    const element = document.getElementById(name);
    decoded.set(name, element ? inflate(element.textContent.trim()) : Promise.resolve(null));
  }
  return decoded.get(name);
}

async function inflate(base64) {
  const packed = Uint8Array.from(atob(base64), letter => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  const whole = new Uint8Array(await new Response(stream).arrayBuffer());
  const end = whole.indexOf(10);
  return { head: JSON.parse(new TextDecoder().decode(whole.subarray(0, end))), bytes: whole.subarray(end + 1) };
}
