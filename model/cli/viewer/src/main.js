// The page of a scene. The command writes what it shows as JSON into #about and its scenes as base64 into #scene-0, #scene-1.
import {Frusta} from './frusta.js';
import {Orbit} from './orbit.js';
import {fitted, lookAt, matrixOf, meetingPoint, poseOf} from './pose.js';
import {readSpz} from './spz.js';
import {Stage} from './stage.js';
import {add, dot, length, perpendicular, sub, turned, unit} from './vectors.js';

const element = (id) => document.getElementById(id);
const FIELD = 0.8;  // radians, of the window's shorter side
const FAR = 10;     // times as far from the middle as the median: a sky, or a stray Gaussian
const BACKGROUNDS = [[1, 1, 1], [0.5, 0.5, 0.5], [0, 0, 0]];

function bytesOf(id) {
  const text = atob(element(id).textContent.trim());
  const out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) out[i] = text.charCodeAt(i);
  return out;
}

// The median of what is opaque, how far from it nearly all of that is, and how far the farthest. As in `vsplat render`, a sky does not count:
// neither a shell that holds most Gaussians nor what is more than ten times as far away as the median.
function extent({count, properties: p}) {
  const step = Math.max(1, Math.floor(count / 20000));
  let points = [];
  for (let i = 0; i < count; i += step) if (p.opacity[i] > -2) points.push([p.x[i], -p.y[i], -p.z[i]]);
  if (!points.length) points = [[0, 0, 0]];
  const middle = (values) => values.sort((a, b) => a - b)[values.length >> 1];
  const centreOf = (some) => [0, 1, 2].map((c) => middle(some.map((v) => v[c])));
  const distancesFrom = (some, centre) => some.map((v) => length(sub(v, centre))).sort((a, b) => a - b);
  let centre = centreOf(points), away = distancesFrom(points, centre);
  const most = away[away.length - 1] || 1;
  const shell = away[away.length >> 1], inside = away.filter((d) => d < 0.9 * shell);
  const inShell = away.filter((d) => Math.abs(d - shell) <= 0.1 * shell).length;
  if (2 * inShell >= away.length && inside.length && FAR * inside[inside.length >> 1] <= shell) {
    points = points.filter((v) => length(sub(v, centre)) < 0.9 * shell);
    centre = centreOf(points);
    away = distancesFrom(points, centre);
  }
  away = away.filter((d) => d <= FAR * away[away.length >> 1]);
  return {centre, radius: away[Math.floor(0.95 * (away.length - 1))] || 1, most};
}

class Page {
  constructor(about, scenes, stage) {
    this.about = about;
    this.stage = stage;
    this.extent = extent(scenes[scenes.length - 1]);
    this.chosen = -1;   // the input camera at which one stands
    this.standing = null;  // {pose, lens}: not orbiting
    const up = about.up || [0, -1, 0];
    const poses = about.cameras.map((camera) => poseOf(camera.w2c));
    this.centre = meetingPoint(poses) || this.extent.centre;
    this.orbit = new Orbit(element('overlay'), up, () => this.moved(), (x, y) => this.pick(x, y));
    const apart = poses.length ? Math.min(...poses.map((pose) => length(sub(pose.eye, this.centre)))) : this.extent.radius;
    this.frusta = new Frusta(element('overlay'), about.cameras, 0.12 * Math.max(apart, 0.05 * this.extent.radius));
    this.showFrusta = about.cameras.length > 0;
    this.split = 0.5;
    this.background = about.background || BACKGROUNDS[0];
    this.start();
    this.connect(scenes);
    this.resize();
  }

  // An object is shown whole, from the side of the first camera that does not look down or up at it; a place, in which the cameras are, from
  // the first camera.
  start() {
    const {centre, radius} = this.extent;
    const eyes = this.about.cameras.map((camera) => poseOf(camera.w2c).eye);
    const distance = (eyes.length ? 1.4 : 1.15) * radius / Math.sin(FIELD / 2);
    if (eyes.length && eyes.some((eye) => length(sub(eye, centre)) < 1.2 * radius)) return this.orbit.set(this.centre, eyes[0]);
    const {up} = this.orbit;
    const sides = eyes.map((eye) => sub(eye, centre));
    const from = sides.find((side) => Math.abs(dot(unit(side), up)) < 0.8) || sides[0] || turned(perpendicular(up), up, 0.6);
    const flat = unit(add(from, up, -dot(from, up)));
    this.orbit.set(centre, add(add(centre, flat, 0.95 * distance), up, 0.3 * distance));
  }

  lens() {
    const W = this.stage.width, H = this.stage.height, f = Math.min(W, H) / 2 / Math.tan(FIELD / 2);
    return {fx: f, fy: f, cx: W / 2, cy: H / 2};
  }

  view() {
    const W = this.stage.width, H = this.stage.height;
    if (this.standing) return {pose: this.standing.pose, lens: fitted(this.standing.lens, W, H), near: this.about.near};
    return {pose: this.orbit.pose(), lens: this.lens(), near: Math.min(this.about.near, 0.05 * this.orbit.distance)};
  }

  show() {
    const {pose, lens, near} = this.view();
    const far = Math.max(2 * near, 4 * (length(sub(pose.eye, this.extent.centre)) + this.extent.most));
    this.stage.look(pose, lens, near, far);
    const photograph = element('photograph');
    photograph.hidden = !(this.chosen >= 0 && this.about.cameras[this.chosen].picture);
    this.frusta.draw(pose, lens, this.chosen, this.frustaAreShown());
    if (photograph.hidden) return;
    for (const side of ['left', 'top', 'width', 'height']) photograph.style[side] = `${lens[side]}px`;
  }

  // A photograph covers them.
  frustaAreShown() {
    return this.showFrusta && element('photograph').hidden;
  }

  resize() {
    this.stage.resize(window.innerWidth, window.innerHeight);
    this.stage.background(this.background);
    this.setSplit(this.split);
    this.show();
  }

  // After a move by hand: one no longer stands at a camera.
  moved() {
    this.leave();
    this.show();
  }

  leave() {
    this.standing = null;
    this.chosen = -1;
    this.say();
  }

  // The orbit continues from where one stood.
  orbitFrom(pose) {
    const ahead = Math.max(dot(sub(this.centre, pose.eye), pose.forward), 0.2 * this.extent.radius);
    this.orbit.set(add(pose.eye, pose.forward, ahead), pose.eye);
  }

  stand(i) {
    const camera = this.about.cameras[i];
    this.chosen = i;
    this.standing = {pose: poseOf(camera.w2c), lens: camera};
    this.orbitFrom(this.standing.pose);
    const photograph = element('photograph');
    if (camera.picture) photograph.src = camera.picture;
    else photograph.removeAttribute('src');
    this.say();
    this.show();
  }

  pick(x, y) {
    if (!this.frustaAreShown()) return;
    const {pose, lens} = this.view();
    const i = this.frusta.at(x, y, pose, lens);
    if (i >= 0 && i !== this.chosen) this.stand(i);
  }

  step(by) {
    const n = this.about.cameras.length;
    if (n) this.stand(((this.chosen < 0 && by < 0 ? 0 : this.chosen) + by + n) % n);
  }

  say() {
    const at = this.chosen >= 0 ? this.about.cameras[this.chosen] : null;
    element('where').textContent = at ? `${this.chosen + 1} of ${this.about.cameras.length}: ${at.name}` : `${this.about.cameras.length} cameras`;
    element('blend').hidden = !(at && at.picture);
  }

  setSplit(at) {
    this.split = at;
    this.stage.split(at);
    element('line').style.left = `${100 * at}%`;
    element('divide').value = at;
  }

  nextBackground() {
    const same = (rgb) => rgb.every((v, i) => Math.abs(v - this.background[i]) < 0.01);
    this.background = BACKGROUNDS[(BACKGROUNDS.findIndex(same) + 1) % BACKGROUNDS.length];
    this.stage.background(this.background);
  }

  replace(scene, bytes) {
    this.stage.replace(this.about.scenes.length - 1, scene);
    this.extent = extent(scene);
    this.bytes = bytes;
    this.count(scene);
    this.show();
  }

  count(scene) {
    element('count').textContent = `${scene.count.toLocaleString('en')} Gaussians`;
  }

  save() {
    const {id, file} = this.about.scenes[this.about.scenes.length - 1];
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([this.bytes || bytesOf(id)], {type: 'application/octet-stream'}));
    link.download = file;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }

  reset() {
    this.leave();
    this.start();
    this.show();
  }

  toggleFrusta() {
    this.showFrusta = !this.showFrusta;
    this.show();
  }

  connect(scenes) {
    const {about} = this;
    element('title').textContent = about.title;
    this.count(scenes[scenes.length - 1]);
    element('cameras').hidden = !about.cameras.length;
    element('compare').hidden = element('line').hidden = about.scenes.length < 2;
    if (about.scenes.length > 1) {
      element('left').textContent = about.scenes[0].name;
      element('right').textContent = about.scenes[1].name;
    }
    this.say();
    const on = (id, type, act) => element(id).addEventListener(type, act);
    on('previous', 'click', () => this.step(-1));
    on('next', 'click', () => this.step(1));
    on('frusta', 'click', () => this.toggleFrusta());
    on('opacity', 'input', (event) => (element('photograph').style.opacity = event.target.value));
    on('divide', 'input', (event) => this.setSplit(Number(event.target.value)));
    on('reset', 'click', () => this.reset());
    on('shade', 'click', () => this.nextBackground());
    on('save', 'click', () => this.save());
    on('help', 'click', () => (element('keys').hidden = !element('keys').hidden));
    window.addEventListener('resize', () => this.resize());
    window.addEventListener('keydown', (event) => this.key(event));
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.tagName === 'INPUT') return;
    const others = {
      '[': () => this.step(-1), ']': () => this.step(1), r: () => this.reset(), c: () => this.toggleFrusta(), b: () => this.nextBackground(),
      '?': () => (element('keys').hidden = !element('keys').hidden)
    };
    const act = others[event.key];
    if (act) act();
    if (act || this.orbit.key(event.key)) event.preventDefault();
  }
}

// What tests and other scripts may use.
function controls(page) {
  const {stage} = page;
  return {
    cameras: page.about.cameras.length,
    // {w2c: [16] row-major, world to camera, x right, y down, z forward; fx, fy, cx, cy, w, h in pixels}. The picture is fitted into the window.
    async setCamera(camera) {
      page.chosen = -1;
      page.standing = {pose: poseOf(camera.w2c), lens: camera};
      page.orbitFrom(page.standing.pose);
      page.show();
      await stage.settled();
    },
    async click(i) {
      page.stand(i);
      await stage.settled();
    },
    // Where camera i is in the window, or null.
    place(i) {
      const {pose, lens} = page.view();
      return page.frusta.place(i, pose, lens);
    },
    chosen: () => page.chosen,
    pose: () => matrixOf(page.view().pose),
    async split(at) {
      page.setSplit(at);
      await stage.settled();
    },
    // Shows another scene, the bytes of an SPZ file, in place of the last one; the view stays.
    async replace(bytes) {
      const last = page.about.scenes.length - 1;
      await page.replace({...await readSpz(bytes), shift: page.about.scenes[last].shift}, bytes);
      await stage.settled();
    },
    // Hides all but the scene.
    bare(on = true) {
      document.body.classList.toggle('bare', on);
    },
    settled: () => stage.settled()
  };
}

async function open() {
  const about = JSON.parse(element('about').textContent);
  const scenes = [];
  for (const {id, shift} of about.scenes) scenes.push({...await readSpz(bytesOf(id)), shift});
  const stage = await Stage.open(element('scene'), scenes);
  const page = new Page(about, scenes, stage);
  await stage.settled();
  element('wait').hidden = true;
  return controls(page);
}

const ready = open();
window.vsplat = {ready};
ready.then((all) => Object.assign(window.vsplat, all), (error) => {
  element('wait').textContent = `This scene cannot be shown: ${error.message || error}`;
  console.error(error);
});
