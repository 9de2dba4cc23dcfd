// Uses the viewer of a page of `mba view` or `mba report` as a person does, and fails when it does not follow or logs an error.
//
//   node walk.mjs PACKAGES PAGE [SCREENSHOT]
//
// PACKAGES is a folder with node_modules, PAGE the absolute path of the page.
import { writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import assert from 'node:assert/strict';

const [packages, page, screenshot] = process.argv.slice(2);
const puppeteer = createRequire(join(packages, 'package.json'))('puppeteer-core');
const browser = await puppeteer.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
const errors = [];
// Pictures a second while the view moves: for people to judge, since it depends on what else the machine does.
let rate = 0;
try {
  const tab = await browser.newPage();
  await tab.setViewport({ width: 1000, height: 760 });
  tab.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
  tab.on('pageerror', (error) => errors.push(String(error)));
  tab.on('request', (request) => { if (/^https?:/.test(request.url())) errors.push(`asks for ${request.url()}`); });
  await tab.evaluateOnNewDocument(() => {
    // Every picture ends with one such call.
    window.picturesShown = 0;
    const { drawArrays } = WebGL2RenderingContext.prototype;
    WebGL2RenderingContext.prototype.drawArrays = function (...how) {
      window.picturesShown += 1;
      return drawArrays.apply(this, how);
    };
  });
  await tab.goto(`file://${page}`);
  await tab.waitForFunction('document.querySelector(".viewer")?.show', { timeout: 120000 });
  await tab.$eval('.viewer', (viewer) => viewer.scrollIntoView());

  const shots = [];
  const shoot = async () => shots.push(await tab.screenshot());
  await new Promise((done) => setTimeout(done, 1500));
  await shoot();
  const canvas = await tab.$('.viewer .map');
  const box = await canvas.boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];

  // How many pictures are shown while the view moves for some seconds; the first of them tell how much the machine can do.
  await tab.mouse.move(x, y);
  await tab.mouse.down();
  const counts = [];
  for (let k = 0; k < 300; k++) {
    const angle = 2 * Math.PI * k / 300;
    await tab.mouse.move(x + 150 * Math.sin(angle), y + 60 * Math.sin(2 * angle));
    await new Promise((done) => setTimeout(done, 16));
    if (k === 60 || k === 299) counts.push(await tab.evaluate('[performance.now(), window.picturesShown]'));
  }
  await tab.mouse.up();
  rate = 1000 * (counts[1][1] - counts[0][1]) / (counts[1][0] - counts[0][0]);
  await new Promise((done) => setTimeout(done, 1500));
  await shoot();

  await tab.mouse.move(x, y);
  await tab.mouse.down();
  await tab.mouse.move(x + 120, y + 10, { steps: 6 });
  await tab.mouse.up();
  await new Promise((done) => setTimeout(done, 1500));
  await shoot();
  await canvas.focus();
  await tab.keyboard.press('w');
  await tab.keyboard.press('ArrowUp');
  await tab.mouse.wheel({ deltaY: 200 });
  await new Promise((done) => setTimeout(done, 1500));
  await shoot();
  await tab.keyboard.press('Home');
  await new Promise((done) => setTimeout(done, 2500));
  await shoot();

  // A keyframe, and its picture over the map.
  const buttons = await tab.$$('.viewer .strip button');
  if (buttons.length > 0) {
    await buttons[Math.floor(buttons.length / 2)].click();
    await tab.waitForFunction('document.querySelector(".viewer [aria-pressed=true]")', { timeout: 30000 });
    await tab.$eval('.viewer input[value=deblurred]', (input) => input.click());
    assert.ok(await tab.$eval('.viewer .picture', (picture) => !picture.hidden), 'the picture is not shown');
    await new Promise((done) => setTimeout(done, 500));
    await shoot();
    await canvas.focus();
    await tab.keyboard.press('ArrowLeft');
    assert.ok(await tab.$eval('.viewer .picture', (picture) => picture.hidden), 'the picture stays over another view');
  }
  const bytes = shots.map((shot) => Buffer.from(shot));
  for (const k of [1, 2, 3, 4]) assert.ok(!bytes[k].equals(bytes[k - 1]), `nothing moved in step ${k}`);
  if (screenshot) writeFileSync(screenshot, bytes[0]);
} finally {
  await browser.close();
}
assert.deepEqual(errors, []);
assert.ok(rate > 0, 'no picture was shown while the view moved');
console.log(`walked through the map with ${rate.toFixed(1)} pictures a second`);
