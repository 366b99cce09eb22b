// Bundles src/ with the parts of PlayCanvas that it uses into one script. Shaders for WebGPU and for lit surfaces become empty texts: the page
// draws splats with WebGL 2.
import {readFile} from 'node:fs/promises';

import {build} from 'esbuild';

const unused = {
  name: 'unused-shaders',
  setup(bundle) {
    bundle.onLoad({filter: /shader-lib[\\/](wgsl[\\/]chunks|glsl[\\/]chunks[\\/](lit|standard))[\\/]/}, async ({path}) => {
      const exported = (await readFile(path, 'utf8')).match(/export \{([^}]*)\}/)[1].split(',');
      const names = exported.map((each) => each.trim().split(' as ').pop());
      return {contents: `const none = '';\nexport {${names.map((name) => `none as ${name}`).join(', ')}};`};
    });
  }
};

// PlayCanvas ends a Gaussian smoothly at 2.8 standard deviations. Other programs, and vsplat render, draw it unchanged down to an opacity of
// 1/255. They also widen its variance by 0.3 square pixels; PlayCanvas, whose unit here is half a pixel, by a quarter of that.
const exact = {
  name: 'exact-gaussians',
  setup(bundle) {
    const wider = ['cov[0][0]', 'cov[1][1]'].flatMap((part) => [[`(${part} + 0.3)`, `(${part} + 1.2)`], [`= ${part} + 0.3;`, `= ${part} + 1.2;`]]);
    const edits = {
      'gsplatCorner.js': wider,
      'gsplatCommon.js': [['min(1.0, sqrt(max(0.0, log(alpha / alphaClipValue))) * 0.5)', 'sqrt(max(0.0, log(alpha / alphaClipValue))) * 0.5']],
      'gsplat.js': [['normExp(A) * gaussianColor.a', 'exp(-4.0 * A) * gaussianColor.a'], ['if (A > 1.0) {', 'if (A > 1.5) {']]
    };
    bundle.onLoad({filter: /glsl[\\/]chunks[\\/]gsplat[\\/](vert[\\/]gsplatCo(mmon|rner)|frag[\\/]gsplat)\.js$/}, async ({path}) => {
      let contents = await readFile(path, 'utf8');
      for (const [from, to] of edits[path.split(/[\\/]/).pop()]) {
        if (!contents.includes(from)) throw new Error(`${path} has no ${from}`);
        contents = contents.replace(from, to);
      }
      return {contents};
    });
  }
};

await build({
  entryPoints: ['src/main.js'], outfile: 'bundle.js', bundle: true, minify: true, format: 'iife', target: 'es2022', charset: 'ascii',
  legalComments: 'none', logLevel: 'warning', plugins: [unused, exact]
});
