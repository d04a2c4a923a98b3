// A camera for `command:`: grey pictures of 640x480 px to standard output, 30 a second, a bright bar wandering through a texture.
// With a number, so many pictures, and then silence.
const [width, height] = [640, 480];
const texture = Buffer.from({ length: width * height }, (_, at) => 60 + (((at * 2654435761) >>> 13) % 90));
let number = 0;

const most = Number(process.argv[2] ?? Infinity);

function next() {
  if (number >= most) return;
  const picture = Buffer.from(texture);
  const left = (8 * number++) % (width - 40);
  for (let row = 0; row < height; row++) picture.fill(230, row * width + left, row * width + left + 40);
  process.stdout.write(picture);
}
setInterval(next, 1000 / 30);
process.stdout.on("error", () => process.exit(0));
