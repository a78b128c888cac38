export default {
  mode: "production",
  entry: { default: "./default.js", address: "./address.js" },
  output: { filename: "[name].js" },
};
