'use strict';
// The bytes of base64; `Uint8Array.from` with a function for each letter takes 30 times as long.
const bytesOf = (text) => {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i += 1) bytes[i] = letters.charCodeAt(i);
  return bytes;
};
// The text of base64 of gzip.
const inflate = async (text) => {
  const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Response(stream).text();
};
// Plotly, which the page contains in compressed form; ready when it can draw.
const library = (async () => {
  const script = document.createElement('script');
  script.textContent = await inflate(document.getElementById('plotly').textContent);
  document.head.append(script);
  script.remove();
})();
