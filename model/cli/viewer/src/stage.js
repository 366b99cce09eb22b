// Draws one scene, or two on either side of a line, with PlayCanvas. A frame is drawn only when something has changed.
import {
  AppBase, AppOptions, CameraComponentSystem, Color, Entity, GSplatComponentSystem, GSplatData, GSplatResource, Layer, Mat4, Quat, TONEMAP_NONE,
  Vec4, createGraphicsDevice
} from 'playcanvas';

// The scene's frame in the file has y up and z back, and the world's y down and z forward: half a turn about x.
const FILE_TO_WORLD = [180, 0, 0];

function resourceOf(device, scene) {
  const properties = Object.entries(scene.properties).map(([name, storage]) => ({type: 'float', name, storage, byteSize: 4}));
  return new GSplatResource(device, new GSplatData([{name: 'vertex', count: scene.count, properties}]));
}

export class Stage {
  // `canvas`; `scenes`, as readSpz() gives them, each with its `shift` in the world.
  static async open(canvas, scenes) {
    const device = await createGraphicsDevice(canvas, {deviceTypes: ['webgl2'], antialias: false, alpha: false, powerPreference: 'high-performance'});
    const options = new AppOptions();
    options.graphicsDevice = device;
    options.componentSystems = [CameraComponentSystem, GSplatComponentSystem];
    const app = new AppBase(canvas);
    app.init(options);
    return new Stage(app, scenes);
  }

  constructor(app, scenes) {
    this.app = app;
    this.waiting = [];
    this.stale = new Set();
    app.autoRender = false;
    app.graphicsDevice.maxPixelRatio = Math.min(window.devicePixelRatio || 1, 2);
    const how = app.scene.gsplat;
    how.antiAlias = scenes[0].antialias;
    how.minPixelSize = 0;
    how.minContribution = 0;
    how.colorUpdateAngle = 0;
    how.colorUpdateDistance = 0;
    how.dataFormat = 'large';
    how.splatBudget = 0;
    this.splats = [];
    this.sides = scenes.map((scene, i) => this.addSide(scene, i));
    app.systems.gsplat.on('frame:request', () => this.draw());
    app.systems.gsplat.on('frame:ready', (camera, layer, ready, loading) => {
      if (ready && !loading) this.stale.delete(camera);
      else this.draw();
    });
    app.on('postrender', () => {
      if (this.stale.size) return this.draw();
      for (const done of this.waiting.splice(0)) done();
    });
    app.start();
  }

  addSide(scene, i) {
    const layer = new Layer({name: `side ${i}`});
    this.app.scene.layers.push(layer);
    const splats = new Entity();
    splats.setEulerAngles(...FILE_TO_WORLD);
    splats.setPosition(...scene.shift);
    splats.addComponent('gsplat', {layers: [layer.id]});
    splats.gsplat.resource = resourceOf(this.app.graphicsDevice, scene);
    this.app.root.addChild(splats);
    this.splats[i] = splats.gsplat;
    const camera = new Entity();
    camera.addComponent('camera', {layers: [layer.id], toneMapping: TONEMAP_NONE, priority: i});
    camera.camera.calculateProjection = (matrix) => matrix.copy(this.projection);
    camera.camera.camera._scissorRectClear = true;  // the line between two scenes bounds what is cleared, too
    this.app.root.addChild(camera);
    return camera;
  }

  // Shows another scene in place of scene i.
  replace(i, scene) {
    const old = this.splats[i].resource;
    this.splats[i].resource = resourceOf(this.app.graphicsDevice, scene);
    old.destroy();
    this.draw();
  }

  resize(width, height) {
    this.width = width, this.height = height;
    this.app.setCanvasFillMode('NONE', width, height);
    this.app.setCanvasResolution('FIXED', width, height);  // times the ratio of pixels
    this.draw();
  }

  // The camera, its lens in pixels of the window, and what is nearest and farthest.
  look(pose, lens, near, far) {
    const W = this.width, H = this.height;
    this.projection = new Mat4();
    this.projection.set([2 * lens.fx / W, 0, 0, 0, 0, 2 * lens.fy / H, 0, 0, 1 - 2 * lens.cx / W, 2 * lens.cy / H - 1,
                         (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0]);
    const {eye, right, down, forward} = pose;
    const turn = new Mat4();
    turn.set([...right, 0, ...down.map((v) => -v), 0, ...forward.map((v) => -v), 0, 0, 0, 0, 1]);
    const rotation = new Quat().setFromMat4(turn);
    for (const side of this.sides) {
      side.setPosition(...eye);
      side.setRotation(rotation);
      side.camera.nearClip = near, side.camera.farClip = far;
    }
    this.draw();
  }

  // Where the line between two scenes stands, 0 to 1 of the window's width.
  split(at) {
    if (this.sides.length < 2) return;
    this.sides[0].camera.scissorRect = new Vec4(0, 0, at, 1);
    this.sides[1].camera.scissorRect = new Vec4(at, 0, 1 - at, 1);
    this.sides[0].enabled = at > 0;
    this.sides[1].enabled = at < 1;
    this.draw();
  }

  background(rgb) {
    for (const side of this.sides) side.camera.clearColor = new Color(...rgb, 1);
    this.draw();
  }

  draw() {
    this.app.renderNextFrame = true;
  }

  // Resolves when what was last asked for has been drawn, in the right order.
  settled() {
    this.stale = new Set(this.sides.filter((side) => side.enabled).map((side) => side.camera));
    this.draw();
    return new Promise((done) => this.waiting.push(() => requestAnimationFrame(done)));
  }
}
