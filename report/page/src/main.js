import uplotStyle from 'uplot/dist/uPlot.min.css';
import {chart} from './charts.js';
import {element} from './dom.js';
import {forest} from './forest.js';
import style from './style.css';
import {facts, table, text} from './tables.js';
import {viewer} from './viewer.js';

const kRenderers = {chart, facts, forest, table, text};

function download(report) {
  const link = element('a', {href: URL.createObjectURL(new Blob([JSON.stringify(report, null, 1)], {type: 'application/json'})), download: 'report.json'});
  link.click();
}

async function build() {
  document.head.append(element('style', {}, uplotStyle + style));
  const report = JSON.parse(document.getElementById('report-data').textContent);
  document.title = report.title;
  const host = document.getElementById('report');
  host.replaceChildren(element('header', {}, element('h1', {}, report.title), element('p', {}, report.subtitle ?? ''),
      element('p', {class: `headline ${report.verdict.state}`}, element('strong', {}, report.verdict.state), ` ${report.verdict.text}`),
      element('button', {type: 'button', onclick: () => download(report)}, 'Save the data (JSON)')));
  const contents = element('nav', {'aria-label': 'Contents'}, element('ul'));
  host.append(contents);
  const waiting = [];
  report.sections.forEach((section, i) => {
    const id = `section-${i}`;
    contents.firstChild.append(element('li', {}, element('a', {href: `#${id}`}, section.title)));
    const part = element('section', {id, 'aria-labelledby': `${id}-title`}, element('h2', {id: `${id}-title`}, section.title));
    if (section.text) part.append(element('p', {}, section.text));
    host.append(part);
    if (section.type === 'viewer') {
      const {node, ready} = viewer(section);
      part.append(node);
      waiting.push(ready);
    } else {
      part.append(kRenderers[section.type](section));
    }
  });
  host.append(element('footer', {}, element('p', {}, report.footer ?? '')));
  await Promise.all(waiting);
  document.body.dataset.ready = 'true';
}

build().catch((error) => {
  document.getElementById('report').textContent = `This report cannot be shown: ${error.message}`;
  throw error;
});
