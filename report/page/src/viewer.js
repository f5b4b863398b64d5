// Two pictures and maps of their differences, looked at together: same zoom, same pixel.
import {unpack, unpackSpectra} from './arrays.js';
import {drawChart, kColours} from './charts.js';
import {element, format} from './dom.js';

const encode = (() => {
  const table = new Uint8Array(4096);
  for (let i = 0; i < 4096; ++i) {
    const v = i / 4095;
    table[i] = Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
  }
  return (v) => table[v <= 0 ? 0 : v >= 1 ? 4095 : (v * 4095) | 0];
})();

// Sequential: dark blue over green to yellow; diverging: blue, white, red. Straight segments in sRGB.
const kSequential = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const kDiverging = [[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]];
function colourOf(stops, t) {
  const position = Math.max(0, Math.min(1, t)) * (stops.length - 1);
  const i = Math.min(stops.length - 2, Math.floor(position));
  return stops[i].map((v, k) => v + (position - i) * (stops[i + 1][k] - v));
}

function paintRgb(image, exposure) {
  const {values, shape: [height, width]} = image.data;
  const pixels = new ImageData(width, height);
  for (let p = 0; p < width * height; ++p) {
    for (let k = 0; k < 3; ++k) pixels.data[4 * p + k] = encode(values[3 * p + k] * exposure);
    pixels.data[4 * p + 3] = 255;
  }
  return pixels;
}

function paintMap(image) {
  const {values, shape: [height, width]} = image.data;
  const [low, high] = image.range;
  const stops = low < 0 ? kDiverging : kSequential;
  const pixels = new ImageData(width, height);
  for (let p = 0; p < width * height; ++p) {
    const value = values[p];
    const colour = Number.isFinite(value) ? colourOf(stops, (value - low) / (high - low)) : [128, 128, 128];
    pixels.data.set([...colour, 255], 4 * p);
  }
  return pixels;
}

class Viewer {
  constructor(section) {
    this.section = section;
    this.mode = 'flip';
    this.shown = 0;
    this.split = 0.5;
    this.exposure = 0;
    this.zoom = 1;
    this.origin = [0, 0];
    this.pixel = [Math.floor(section.height / 2), Math.floor(section.width / 2)];
    this.bitmaps = [];
    this.build();
  }

  build() {
    const {section} = this;
    this.canvas = element('canvas', {width: 512, height: 512, tabindex: '0', role: 'img',
      'aria-label': 'Picture. Arrow keys move the pixel, + and - zoom, F flips, S slides, 0 shows all.',
      onkeydown: (event) => this.onKey(event), onclick: (event) => this.onClick(event),
      onwheel: (event) => this.onWheel(event), onpointerdown: (event) => this.onDragStart(event)});
    this.readout = element('p', {class: 'readout', role: 'status'}, 'The pictures are being unpacked …');
    this.buttons = section.images.map((image, i) => element('button', {type: 'button', 'aria-pressed': 'false',
      onclick: () => this.show(i)}, image.name));
    this.slideButton = element('button', {type: 'button', 'aria-pressed': 'false', onclick: () => this.setMode('slide')}, 'Slider');
    const range = (label, attributes, change) => {
      const input = element('input', {type: 'range', ...attributes, oninput: () => change(Number(input.value))});
      return element('label', {}, label, ' ', input);
    };
    this.bar = element('p', {class: 'colourbar'});
    this.spectrumHost = element('div', {class: 'chart', role: 'img', 'aria-label': 'Spectra at the chosen pixel with two standard errors'});
    const controls = element('div', {class: 'controls', role: 'group', 'aria-label': 'What is shown'}, ...this.buttons, this.slideButton,
        element('button', {type: 'button', onclick: () => this.setZoom(1)}, 'Whole picture'),
        element('button', {type: 'button', onclick: () => this.setZoom(this.zoom * 2)}, 'Zoom in'),
        range('Exposure', {min: -4, max: 6, step: 0.5, value: 0}, (value) => { this.exposure = value; this.repaint(); }),
        range('Slider', {min: 0, max: 1, step: 0.01, value: 0.5}, (value) => { this.split = value; this.setMode('slide'); }));
    this.node = element('div', {class: 'viewer'}, controls,
        element('div', {class: 'panes'}, element('div', {}, this.canvas, this.bar, this.readout), this.spectrumHost));
  }

  async load() {
    const {section} = this;
    for (const image of section.images) image.data = await unpack(image.values);
    this.spectra = [];
    for (const one of section.spectra ?? []) {
      this.spectra.push({name: one.name, mean: await unpackSpectra(one.mean), error: one.error ? await unpackSpectra(one.error) : null});
    }
    new ResizeObserver(() => this.drawSpectra()).observe(this.spectrumHost);
    await this.repaint();
    this.show(0);
    this.node.dataset.ready = 'true';
  }

  async repaint() {
    this.bitmaps = await Promise.all(this.section.images.map((image) =>
        createImageBitmap(image.kind === 'rgb' ? paintRgb(image, 2 ** this.exposure) : paintMap(image))));
    this.draw();
  }

  show(index) {
    this.shown = index;
    this.setMode('flip');
  }

  setMode(mode) {
    this.mode = mode;
    this.buttons.forEach((button, i) => button.setAttribute('aria-pressed', String(mode === 'flip' && i === this.shown)));
    this.slideButton.setAttribute('aria-pressed', String(mode === 'slide'));
    this.draw();
  }

  setZoom(zoom) {
    const {width, height} = this.section;
    this.zoom = Math.max(1, Math.min(64, zoom));
    const [row, column] = this.pixel;
    const view = [height / this.zoom, width / this.zoom];
    this.origin = [Math.max(0, Math.min(height - view[0], row - view[0] / 2)), Math.max(0, Math.min(width - view[1], column - view[1] / 2))];
    this.draw();
  }

  draw() {
    if (this.bitmaps.length === 0) return;
    const {width, height} = this.section;
    const {canvas} = this;
    const size = Math.min(768, 512 * Math.ceil(Math.max(width, height) / 512));
    canvas.width = width >= height ? size : Math.round((size * width) / height);
    canvas.height = Math.round((canvas.width * height) / width);
    const context = canvas.getContext('2d');
    context.imageSmoothingEnabled = false;
    const view = [height / this.zoom, width / this.zoom];
    const put = (bitmap, from, to) => context.drawImage(bitmap, this.origin[1] + from * view[1], this.origin[0], (to - from) * view[1], view[0],
        from * canvas.width, 0, (to - from) * canvas.width, canvas.height);
    if (this.mode === 'slide' && this.bitmaps.length > 1) {
      put(this.bitmaps[0], 0, this.split);
      put(this.bitmaps[1], this.split, 1);
      context.fillStyle = '#fff';
      context.fillRect(this.split * canvas.width - 1, 0, 2, canvas.height);
    } else {
      put(this.bitmaps[this.shown], 0, 1);
    }
    const [row, column] = this.pixel;
    const scale = canvas.width / view[1];
    context.strokeStyle = '#fff';
    context.lineWidth = 3;
    const box = [(column - this.origin[1]) * scale, (row - this.origin[0]) * scale, scale, scale];
    context.strokeRect(...box);
    context.strokeStyle = '#000';
    context.lineWidth = 1;
    context.strokeRect(...box);
    this.describe();
  }

  describe() {
    const [row, column] = this.pixel;
    const value = (image) => {
      const channels = image.kind === 'rgb' ? 3 : 1;
      const at = (row * this.section.width + column) * channels;
      return Array.from(image.data.values.slice(at, at + channels), format).join(', ');
    };
    const parts = this.section.images.map((image) => `${image.name} ${value(image)} ${image.unit}`);
    this.readout.textContent = `Row ${row}, column ${column}: ${parts.join(' · ')}`;
    const image = this.section.images[this.shown];
    this.bar.textContent = this.mode === 'flip' && image.range ? `${image.name}: ${format(image.range[0])} to ${format(image.range[1])} ${image.unit}` : '';
    this.bar.classList.toggle('diverging', Boolean(image.range && image.range[0] < 0));
    this.bar.classList.toggle('sequential', Boolean(image.range && image.range[0] >= 0));
  }

  drawSpectra() {
    if (!this.spectra?.length || this.spectrumHost.clientWidth === 0) return;
    const {height, width} = this.section;
    const [row, column] = this.pixel;
    const series = this.spectra.map((one, k) => {
      const y = one.mean.at(row, column, height, width);
      const line = {name: one.name, x: one.mean.wavelength, y, colour: kColours[k % kColours.length], points: y.length < 3};
      if (one.error) {
        const error = one.error.at(row, column, height, width);
        line.low = y.map((v, i) => v - 2 * error[i]);
        line.high = y.map((v, i) => v + 2 * error[i]);
      }
      return line;
    });
    drawChart(this.spectrumHost, {series, x: {label: 'Wavelength [nm]'}, y: {label: `Radiance [${this.section.spectral_unit}]`}}, 320);
  }

  move(row, column) {
    this.pixel = [Math.max(0, Math.min(this.section.height - 1, row)), Math.max(0, Math.min(this.section.width - 1, column))];
    const view = [this.section.height / this.zoom, this.section.width / this.zoom];
    const inside = [0, 1].every((k) => this.pixel[k] >= this.origin[k] && this.pixel[k] < this.origin[k] + view[k]);
    if (inside) this.draw();
    else this.setZoom(this.zoom);
    this.drawSpectra();
  }

  pixelAt(event) {
    const box = this.canvas.getBoundingClientRect();
    return [this.origin[0] + ((event.clientY - box.top) / box.height) * (this.section.height / this.zoom),
      this.origin[1] + ((event.clientX - box.left) / box.width) * (this.section.width / this.zoom)];
  }

  onClick(event) {
    const [row, column] = this.pixelAt(event);
    this.move(Math.floor(row), Math.floor(column));
  }

  onWheel(event) {
    event.preventDefault();
    const [row, column] = this.pixelAt(event);
    this.pixel = [Math.floor(row), Math.floor(column)];
    this.setZoom(this.zoom * (event.deltaY < 0 ? 1.25 : 0.8));
  }

  onDragStart(event) {
    if (this.zoom === 1) return;
    const start = [event.clientX, event.clientY];
    const origin = [...this.origin];
    const box = this.canvas.getBoundingClientRect();
    const drag = (moved) => {
      const view = [this.section.height / this.zoom, this.section.width / this.zoom];
      this.origin = [Math.max(0, Math.min(this.section.height - view[0], origin[0] - ((moved.clientY - start[1]) / box.height) * view[0])),
        Math.max(0, Math.min(this.section.width - view[1], origin[1] - ((moved.clientX - start[0]) / box.width) * view[1]))];
      this.draw();
    };
    this.canvas.addEventListener('pointermove', drag);
    addEventListener('pointerup', () => this.canvas.removeEventListener('pointermove', drag), {once: true});
  }

  onKey(event) {
    const [row, column] = this.pixel;
    const actions = {
      ArrowUp: () => this.move(row - 1, column),
      ArrowDown: () => this.move(row + 1, column),
      ArrowLeft: () => this.move(row, column - 1),
      ArrowRight: () => this.move(row, column + 1),
      '+': () => this.setZoom(this.zoom * 2),
      '-': () => this.setZoom(this.zoom / 2),
      0: () => this.setZoom(1),
      f: () => this.show(this.shown === 0 ? 1 % this.bitmaps.length : 0),
      s: () => this.setMode('slide'),
    };
    const action = actions[event.key];
    if (!action || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    action();
  }
}

export function viewer(section) {
  const one = new Viewer(section);
  return {node: one.node, ready: one.load()};
}
