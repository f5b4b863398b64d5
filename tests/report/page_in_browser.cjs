// Opens the example page in headless Chromium: node page_in_browser.cjs EXAMPLE_PROGRAM OUTPUT_FOLDER
const {execFileSync} = require('node:child_process');
const {writeFileSync, mkdtempSync} = require('node:fs');
const {tmpdir} = require('node:os');
const path = require('node:path');
const assert = require('node:assert');

const [program, folder] = process.argv.slice(2);
if (!process.env.CHROMIUM || process.env.CHROMIUM.endsWith('NOTFOUND')) {
  console.log('skipped: Chromium is not installed (apt-get install chromium)');
  process.exit(77);
}
const {chromium} = require('playwright-core');
const axe = require('axe-core');

(async () => {
  const file = path.join(folder, 'example_report.html');
  const html = execFileSync(program, {maxBuffer: 1 << 28});
  writeFileSync(file, html);
  assert(html.length < 15e6, `the page has ${html.length} bytes`);
  const browser = await chromium.launchPersistentContext(mkdtempSync(path.join(tmpdir(), 'interglow-')), {
    executablePath: process.env.CHROMIUM,
    headless: true,
    viewport: {width: 1200, height: 900},
    args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
  try {
    const page = await browser.newPage();
    const problems = [];
    const requests = [];
    page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) problems.push(message.text()); });
    page.on('pageerror', (error) => problems.push(error.message));
    page.on('request', (request) => { if (!/^(file|data|blob):/.test(request.url())) requests.push(request.url()); });
    await page.goto(`file://${file}`);
    await page.waitForFunction(() => document.body.dataset.ready === 'true', null, {timeout: 20000}).catch(() => { throw new Error(`the page does not get ready: ${problems.join(' | ')}`); });

    const readout = () => page.locator('.readout').innerText();
    const first = await readout();
    await page.getByRole('button', {name: 'Path tracer'}).click();
    assert.equal(await page.getByRole('button', {name: 'Path tracer'}).getAttribute('aria-pressed'), 'true');
    const canvas = page.locator('.viewer canvas[tabindex]');
    await canvas.click({position: {x: 40, y: 60}});
    assert.notEqual(await readout(), first, 'a click must move the pixel');
    const before = await readout();
    await canvas.focus();
    await page.keyboard.press('ArrowRight');
    const column = (text) => Number(/column (\d+)/.exec(text)[1]);
    assert.equal(column(await readout()), column(before) + 1, 'the right arrow moves one pixel');
    const pixels = () => canvas.evaluate((node) => node.toDataURL());
    const whole = await pixels();
    await page.keyboard.press('+');
    assert.notEqual(await pixels(), whole, '+ must zoom');
    await page.keyboard.press('0');
    await page.keyboard.press('s');
    assert.equal(await page.getByRole('button', {name: 'Slider'}).getAttribute('aria-pressed'), 'true');
    await page.getByRole('button', {name: 'Relative difference'}).click();
    assert.match(await page.locator('.colourbar').innerText(), /-2 to 2 %/);
    await page.getByLabel('Exposure').fill('2');
    assert(await page.locator('.chart canvas').count() >= 3, 'spectra and charts are drawn');
    await page.keyboard.press('Tab');
    assert.notEqual(await page.evaluate(() => document.activeElement.tagName), 'BODY', 'Tab reaches controls');
    await page.screenshot({path: path.join(folder, 'report_wide.png'), fullPage: true});

    // Tables scroll on their own; none has to, neither at a desk nor on a phone.
    const tables_that_scroll = () => page.locator('.scroll').evaluateAll((nodes) =>
        nodes.filter((node) => node.scrollWidth > node.clientWidth).map((node) => `${node.getAttribute('aria-label')}: ${node.scrollWidth} px in ${node.clientWidth} px`));
    await page.setViewportSize({width: 1280, height: 900});
    assert.deepEqual(await tables_that_scroll(), []);

    await page.setViewportSize({width: 390, height: 800});
    assert.deepEqual(await tables_that_scroll(), []);
    const overflow = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    assert(overflow <= 0, `a phone-wide window scrolls sideways by ${overflow} px`);
    await page.screenshot({path: path.join(folder, 'report_narrow.png'), fullPage: true});

    await page.evaluate(axe.source);
    const found = await page.evaluate(() => window.axe.run());
    for (const violation of found.violations) problems.push(`axe: ${violation.id}: ${violation.nodes.map((node) => node.html).join(' ; ').slice(0, 400)}`);
    assert.deepEqual(problems, []);
    assert.deepEqual(requests, []);
    console.log(`page of ${html.length} bytes: clicks, keys, narrow window and axe-core (${found.passes.length} rules) in order`);
  } finally {
    await browser.close();
  }
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
