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

await build({
  entryPoints: ['src/main.js'], outfile: 'bundle.js', bundle: true, minify: true, format: 'iife', target: 'es2022', charset: 'ascii',
  legalComments: 'none', logLevel: 'warning', plugins: [unused]
});
