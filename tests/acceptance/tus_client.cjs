// Uploads a file with tus-js-client: ENDPOINT FILE CHUNK NOTES. It writes the address of the upload to NOTES, and continues that
// upload when it is started again; it prints the address in the end.
const fs = require('fs')
const path = require('path')
const { createRequire } = require('module')
// Modules of another directory, whose package decides what `require` gets.
const tus = createRequire(path.join(process.env.NODE_PATH, 'x.js'))('tus-js-client')

const [endpoint, file, chunk, notes] = process.argv.slice(2)
const known = fs.existsSync(notes) ? fs.readFileSync(notes, 'utf8') : null
const upload = new tus.Upload(fs.createReadStream(file), {
  endpoint,
  uploadUrl: known,
  chunkSize: Number(chunk),
  uploadSize: fs.statSync(file).size,
  metadata: { filename: path.basename(file) },
  retryDelays: Array(200).fill(50),
  onUploadUrlAvailable: () => fs.writeFileSync(notes, upload.url),
  onError: (error) => {
    console.error(String(error))
    process.exit(1)
  },
  onSuccess: () => console.log(upload.url),
})
upload.start()
