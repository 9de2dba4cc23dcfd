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
try {
  const tab = await browser.newPage();
  await tab.setViewport({ width: 1000, height: 760 });
  tab.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
  tab.on('pageerror', (error) => errors.push(String(error)));
  tab.on('request', (request) => { if (/^https?:/.test(request.url())) errors.push(`asks for ${request.url()}`); });
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
  for (const k of [1, 2, 3]) assert.ok(!bytes[k].equals(bytes[k - 1]), `nothing moved in step ${k}`);
  if (screenshot) writeFileSync(screenshot, bytes[0]);
} finally {
  await browser.close();
}
assert.deepEqual(errors, []);
console.log('walked through the map');
