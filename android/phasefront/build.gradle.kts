// The Gradle library: the Kotlin API over the generated code, and libphasefront_ffi.so for two ABIs. Needs cargo,
// cargo-ndk 4 and NDK r28 or later, which aligns libraries to pages of 16 KB.
import com.vanniktech.maven.publish.AndroidSingleVariantLibrary
import org.jetbrains.kotlin.gradle.dsl.JvmTarget
import org.jetbrains.kotlin.gradle.dsl.KotlinVersion

plugins {
    alias(libs.plugins.android.library)
    alias(libs.plugins.kotlin.android)
    alias(libs.plugins.maven.publish)
}

val workspace: File = rootDir.parentFile
fun ofCargo(key: String): String = Regex("""(?m)^$key = "(.+)"$""")
    .find(workspace.resolve("Cargo.toml").readText())!!.groupValues[1]
val phasefrontVersion = ofCargo("version")

group = "org.phasefront"
version = phasefrontVersion

// gradle.properties says what the two artefacts have.
val isFull = providers.gradleProperty("phasefront.full").map(String::toBoolean).get()
val artefact = if (isFull) "phasefront-full" else "phasefront"
val features = if (isFull) "built-in-network,tract,gpu" else "built-in-network"

val libraries = layout.buildDirectory.dir("rust/jniLibs")
val generated = layout.buildDirectory.dir("generated/uniffi")

val buildRust by tasks.registering(Exec::class) {
    description = "Builds libphasefront_ffi.so for the phones' ABIs."
    workingDir = workspace
    inputs.property("features", features)
    inputs.files(fileTree(workspace) { include("Cargo.*", "bindings/src/**", "bindings/Cargo.toml", "sdk/**", "models/*.onnx") })
    outputs.dir(libraries)
    commandLine(
        "cargo", "ndk", "--target", "arm64-v8a", "--target", "x86_64", "--platform", "26",
        "--output-dir", libraries.get().asFile.path, "build", "--profile", "mobile", "--package", "phasefront-ffi",
        "--no-default-features", "--features", features,
    )
}

val generateKotlin by tasks.registering(Exec::class) {
    description = "Generates the Kotlin under the API from the library."
    dependsOn(buildRust)
    workingDir = workspace
    inputs.files("$workspace/bindings/uniffi.toml", "$rootDir/uniffi.toml")
    inputs.dir(libraries)
    outputs.dir(generated)
    commandLine(
        "cargo", "run", "--release", "--package", "phasefront-bindgen", "--bin", "uniffi-bindgen", "--", "generate",
        libraries.get().file("arm64-v8a/libphasefront_ffi.so").asFile.path, "--language", "kotlin", "--no-format",
        "--config", "$rootDir/uniffi.toml", "--out-dir", generated.get().asFile.path,
    )
}

android {
    namespace = "org.phasefront"
    compileSdk = 36
    ndkVersion = "28.2.13676358"

    defaultConfig {
        minSdk = 26
        consumerProguardFiles("consumer-rules.pro")
        testInstrumentationRunner = "android.test.InstrumentationTestRunner"
        ndk { abiFilters += listOf("arm64-v8a", "x86_64") }
    }

    compileOptions {
        sourceCompatibility = JavaVersion.VERSION_17
        targetCompatibility = JavaVersion.VERSION_17
    }

    sourceSets["main"].apply {
        // `core` uses no Android class, so pom.xml and android/test test it on a JVM.
        kotlin.srcDirs("src/core/kotlin", generated)
        // The third-party notices of the library.
        resources.srcDir("src/core/resources")
        jniLibs.srcDir(libraries)
    }

    packaging { jniLibs.useLegacyPackaging = false }
}

kotlin {
    // Apps with this Kotlin or a later one can use the library.
    coreLibrariesVersion = libs.versions.kotlin.least.get()
    compilerOptions {
        jvmTarget.set(JvmTarget.JVM_17)
        languageVersion.set(KotlinVersion.KOTLIN_2_2)
        apiVersion.set(KotlinVersion.KOTLIN_2_2)
    }
}

tasks.named("preBuild") { dependsOn(generateKotlin) }

dependencies {
    api(libs.coroutines)
    implementation("${libs.jna.get()}@aar")
    // For the generated Kotlin.
    compileOnly(libs.annotation)
}

mavenPublishing {
    configure(AndroidSingleVariantLibrary("release", sourcesJar = true, publishJavadocJar = true))
    publishToMavenCentral()
    signAllPublications()
    coordinates("org.phasefront", artefact, phasefrontVersion)
    pom {
        name.set("Phasefront")
        description.set("RGB-D frames to phase-only 3D holograms, on the device")
        url.set(ofCargo("homepage"))
        licenses {
            license {
                name.set("MIT OR Apache-2.0")
            }
        }
        developers {
            developer {
                name.set("The Phasefront developers")
                url.set(ofCargo("homepage"))
            }
        }
        scm {
            url.set(ofCargo("repository"))
            connection.set("scm:git:${ofCargo("repository")}.git")
        }
    }
}
