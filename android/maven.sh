# Makes the documents of the Kotlin API and its artefact for JVMs by Maven. android/test and release/linux source this
# file and set `cache`.
# shellcheck shell=bash

# Stays offline if an earlier run fetched everything for these pom.xml files.
fetched="$cache/maven/fetched-$(cat android/pom.xml android/consumer/pom.xml | sha256sum | cut -c 1-16)"
offline=()
[ ! -e "$fetched" ] || offline=(--offline -Daether.offline.protocols=file)
# Its programs end before the second compiler of the virtual machine has paid for itself.
export MAVEN_OPTS="${MAVEN_OPTS:-} -XX:TieredStopAtLevel=1"
maven() {
    mvn --batch-mode "${offline[@]}" "-Dmaven.repo.local=$cache/maven" --file android/pom.xml "$@"
}

# generate_kotlin GENERATOR LIBRARY FOLDER: generates Kotlin for JVMs and for Android by UniFFI, into FOLDER/jvm and
# FOLDER/android.
generate_kotlin() {
    "$1" generate "$2" --language kotlin --no-format --config bindings/uniffi.toml --out-dir "$3/jvm" &&
        "$1" generate "$2" --language kotlin --no-format --config android/uniffi.toml --out-dir "$3/android" &&
        tests/snippets kotlin "$3/snippets"
}

# document_kotlin FOLDER: documents the generated code in FOLDER and the hand-written code, into FOLDER/documents.
# Replaces the Rust links in the generated code by plain words.
document_kotlin() {
    mkdir -p "$1/documented"
    cp -r "$1/android/." "$1/documented"
    find "$1/documented" -name '*.kt' -exec sed -i -E 's/\[`(Self::)?(\w+)`\]/`\2`/g' {} +
    maven -Pandroid "-Dsnippets=$1/snippets" "-Dgenerated=$1/documented" "-Doutput=$1/android-classes" "-Ddocuments=$1/documents" \
        dokka:dokka >"$1/dokka.log" 2>&1 && grep -q 'Rendering' "$1/dokka.log" && [ -e "$1/documents/index.html" ] || {
        tail -20 "$1/dokka.log"
        return 1
    }
}

# publish_jvm FOLDER NATIVES: publishes the artefact for JVMs into the Maven repository FOLDER/repository. NATIVES has a
# folder with the library for each platform, named as in JNA.
publish_jvm() {
    mkdir -p "$1/sources"
    cp -r android/phasefront/src/core/kotlin/. "$1/jvm/." "$1/sources"
    # Offline, Maven deploys nothing, not even into a folder.
    local offline=()
    maven --quiet -Ppublish "-Dsnippets=$1/snippets" "-Dgenerated=$1/jvm" "-Doutput=$1/published" "-Dsources=$1/sources" \
        "-Ddocuments=$1/documents" "-Dnatives=$2" "-DaltDeploymentRepository=made::file://$1/repository" \
        -Dmaven.test.skip -Dmaven.install.skip deploy
}
