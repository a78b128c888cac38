const headers = {
  "Cross-Origin-Opener-Policy": "same-origin",
  "Cross-Origin-Embedder-Policy": "require-corp",
};

export default {
  optimizeDeps: { exclude: ["phasefront"] },
  server: { headers },
  build: { rollupOptions: { input: ["default.html", "address.html"] }, target: "es2022" },
};
