"use strict";
// Called by check_rerun.sh: a picture of Rerun's web viewer, which draws by WebGL.
const { chromium } = require("playwright-core");

const [address, picture] = process.argv.slice(2);
const WAIT_MS = 60_000;

const main = async () => {
  const browser = await chromium.launch({
    executablePath: process.env.TAGALONG_CHROMIUM,
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
  });
  const page = await browser.newPage({ viewport: { width: 1500, height: 900 } });
  page.on("pageerror", (error) => console.error(error.message));
  await page.goto(address);
  await page.waitForSelector("canvas");
  await page.waitForTimeout(WAIT_MS);
  await page.screenshot({ path: picture });
  await browser.close();
  console.log(`rerun: ${picture} to look at`);
};

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
