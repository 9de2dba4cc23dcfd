// Shows a map in a page of this folder from the poses of a file, and writes what it shows.
//
//   node capture.mjs PACKAGES PAGE MAP CAMERA POSES OUT [DENSITY]
//
// PACKAGES is a folder with node_modules; PAGE one of this folder, or the absolute path of a page of `mba view` or `mba report`,
// which has its map; MAP a file of Gaussians; CAMERA a JSON file with width, height, fx, fy, cx and cy;
// POSES lines `name tx ty tz qx qy qz qw`, camera-to-world. OUT gets NAME.png for each of them. With DENSITY, the page has so many
// pixels along each side of one of CAMERA, as screens have, and their mean is written. Fails when the page logs an error.
import { createServer } from 'node:http';
import { createReadStream, mkdirSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

const [packages, asked, map, camera, poses, out, density = 1] = process.argv.slice(2);
// What follows `#` is for the page of `mba view`.
const [page, how = ''] = asked.split('#');
const here = dirname(fileURLToPath(import.meta.url));
const puppeteer = createRequire(join(packages, 'package.json'))('puppeteer-core');

const types = { html: 'text/html', mjs: 'text/javascript', js: 'text/javascript', json: 'application/json' };
const recorded = JSON.parse(readFileSync(camera));
const shown = {
  ...Object.fromEntries(['width', 'height', 'fx', 'fy'].map((name) => [name, recorded[name] * density])),
  ...Object.fromEntries(['cx', 'cy'].map((name) => [name, (recorded[name] + 0.5) * density - 0.5])),
};
const place = (url) => {
  if (url === '/map.ply') return map;
  const path = normalize(url);
  return path.startsWith('/node_modules/') ? join(packages, path) : join(here, path);
};
const server = createServer((request, response) => {
  const { pathname } = new URL(request.url, 'http://localhost');
  if (pathname === '/camera.json') { response.end(JSON.stringify(shown)); return; }
  const path = place(pathname);
  try { statSync(path); } catch { response.writeHead(404).end(); return; }
  response.writeHead(200, { 'content-type': types[path.split('.').pop()] ?? 'application/octet-stream' });
  createReadStream(path).pipe(response);
});
await new Promise((done) => server.listen(0, '127.0.0.1', done));

const { width, height } = shown;
const browser = await puppeteer.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--force-color-profile=srgb'],
});
// Runs in the page: the mean of whole blocks of pixels, as a PNG in base64.
const reduce = async (png, width, height) => {
  const bytes = Uint8Array.from(atob(png), (letter) => letter.charCodeAt(0));
  const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
  const sheet = document.createElement('canvas');
  const context = sheet.getContext('2d');
  [sheet.width, sheet.height] = [bitmap.width, bitmap.height];
  context.drawImage(bitmap, 0, 0);
  const [all, side] = [context.getImageData(0, 0, bitmap.width, bitmap.height).data, bitmap.width / width];
  const mean = context.createImageData(width, height);
  for (let k = 0; k < mean.data.length; k++) {
    const [x, y, channel] = [(k >> 2) % width, Math.floor((k >> 2) / width), k & 3];
    let sum = 0;
    for (let j = 0; j < side; j++) {
      for (let i = 0; i < side; i++) sum += all[4 * ((y * side + j) * bitmap.width + x * side + i) + channel];
    }
    mean.data[k] = Math.round(sum / (side * side));
  }
  [sheet.width, sheet.height] = [width, height];
  context.putImageData(mean, 0, 0);
  return sheet.toDataURL('image/png').split(',')[1];
};
const errors = [];
try {
  const tab = await browser.newPage();
  await tab.setViewport({ width, height, deviceScaleFactor: 1 });
  tab.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
  tab.on('pageerror', (error) => errors.push(String(error)));
  await tab.goto(page.startsWith('/') ? `file://${page}#plain,${how}` : `http://127.0.0.1:${server.address().port}/${page}`);
  await tab.waitForFunction('window.ready || document.querySelector(".viewer")?.show', { timeout: 120000 });
  mkdirSync(out, { recursive: true });
  for (const line of readFileSync(poses, 'utf8').split('\n').filter((line) => line && !line.startsWith('#'))) {
    const [name, ...numbers] = line.split(' ');
    const [x, y, z, ...rotation] = numbers.map(Number);
    const show = (place, rotation) => (window.ready ? window : document.querySelector('.viewer')).show(place, rotation);
    await tab.evaluate(show, [x, y, z], rotation);
    const png = await tab.screenshot({ encoding: 'base64', clip: { x: 0, y: 0, width, height } });
    const reduced = Number(density) === 1 ? png : await tab.evaluate(reduce, png, recorded.width, recorded.height);
    writeFileSync(join(out, `${name}.png`), Buffer.from(reduced, 'base64'));
  }
} finally {
  await browser.close();
  server.close();
}
// The icon that browsers ask for is not there.
const real = errors.filter((error) => !error.includes('404'));
if (real.length > 0) {
  console.error(real.join('\n'));
  process.exit(1);
}
